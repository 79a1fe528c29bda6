// Tests the pages of plans in headless Chromium: an arm that reaches, with and without limits that it meets, a
// quadruped that trots, meshes, and a walk in the simulation. PAGES names their folder.
//
// Checks that a page causes no requests and no errors, and that slider, player and keys move the robot. Also checks a
// gait, dark mode, small windows, printing, and a link to a time. Pictures are written to PAGES.
import assert from "node:assert/strict";
import { existsSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { pathToFileURL } from "node:url";
import puppeteer from "puppeteer-core";

const folder = process.env.PAGES;
const PATIENCE = 300_000; // ms; pictures are drawn without a GPU, on a machine that may be busy
let browser;

before(async () => {
  const own = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(existsSync);
  const executablePath = process.env.CHROMIUM ?? own ?? (await (await import("@sparticuz/chromium")).default.executablePath());
  browser = await puppeteer.launch({
    executablePath, headless: "shell", timeout: PATIENCE, protocolTimeout: PATIENCE, env: { ...process.env, LC_ALL: "en_US.UTF-8", LANG: "en_US.UTF-8", LANGUAGE: "en" },
    args: ["--no-sandbox", "--lang=en-US", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"],
  });
});
after(() => browser?.close());

/** Opens a page, and collects its errors, its warnings and the addresses that it requests. */
async function open(name, { hash = "#t=0", width = 900, height = 640, dark = false } = {}) {
  const page = await browser.newPage();
  page.setDefaultTimeout(PATIENCE);
  const wrong = [];
  page.on("console", (message) => { if (["error", "warn", "warning"].includes(message.type()) && !/GPU stall|GL Driver/.test(message.text())) wrong.push(message.text()); });
  page.on("pageerror", (error) => wrong.push(error.message));
  page.on("request", (request) => { if (!/^(file|data|blob):/.test(request.url())) wrong.push(request.url()); });
  await page.setViewport({ width, height });
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: dark ? "dark" : "light" }]);
  await page.goto(pathToFileURL(join(folder, `${name}.html`)).href + hash, { waitUntil: "load" });
  await settled(page);
  return { page, wrong };
}
/** Waits for two frames, after which all changes are drawn. */
const settled = (page) => page.evaluate(() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))));
const picture = async (page) => Buffer.from(await (await page.$("#view canvas")).screenshot()).toString("base64");
const clock = (page) => page.$eval("#clock b", (b) => Number(b.textContent));

for (const name of ["reach", "trot"]) {
  test(`${name}: nothing is asked for, nothing goes wrong, the slider moves the robot`, async () => {
    const { page, wrong } = await open(name);
    const start = await picture(page);
    await page.$eval("#scrub", (scrub) => { scrub.value = 0.4; scrub.dispatchEvent(new Event("input")); });
    await settled(page);
    assert.ok(Math.abs((await clock(page)) - 0.4) < 0.006);
    assert.notEqual(await picture(page), start);
    await page.screenshot({ path: join(folder, `${name}.png`) });
    assert.deepEqual(wrong, []);
    await page.close();
  });

  test(`${name}: play, pause and keys`, async () => {
    const { page, wrong } = await open(name);
    await page.select("#speed", "0.1");
    // The page's own script pauses the motion: on slow machines, the motion would end before a command of this test
    // arrives.
    const pausing = page.evaluate(() => new Promise((done) => {
      const look = () => {
        if (Number(document.querySelector("#clock b").textContent) <= 0.02) return requestAnimationFrame(look);
        document.querySelector("#play").click();
        return done();
      };
      look();
    }));
    await page.click("#play");
    await pausing;
    const paused = await clock(page);
    await settled(page);
    assert.equal(await clock(page), paused);
    await page.evaluate(() => document.activeElement.blur());
    for (let k = 0; k < 2; k++) await page.keyboard.press("ArrowRight"); // the first step may be shorter than the clock's resolution
    const stepped = await clock(page);
    assert.ok(stepped > paused);
    await page.keyboard.press("Space");
    await page.waitForFunction((stepped) => Number(document.querySelector("#clock b").textContent) > stepped, {}, stepped);
    assert.deepEqual(wrong, []);
    await page.close();
  });

  test(`${name}: a link opens it at a time, and the address follows`, async () => {
    const { page, wrong } = await open(name, { hash: "#t=0.3" });
    assert.equal(await clock(page), 0.3);
    await page.evaluate(() => document.activeElement.blur());
    await page.keyboard.press("ArrowRight");
    await page.waitForFunction(() => /^#t=0\.3[01]/.test(location.hash) && location.hash !== "#t=0.3");
    await page.evaluate(() => { location.hash = "#t=0.5"; });
    await page.waitForFunction(() => document.querySelector("#clock b").textContent === "0.50");
    assert.deepEqual(wrong, []);
    await page.close();
  });

  test(`${name}: any window, dark mode, paper`, async () => {
    const { page, wrong } = await open(name, { dark: true });
    const colour = (page) => page.evaluate(() => getComputedStyle(document.body).backgroundColor);
    const dark = await colour(page);
    const wide = await page.$eval("#view canvas", (canvas) => canvas.clientWidth);
    await page.screenshot({ path: join(folder, `${name}_dark.png`) });
    await page.setViewport({ width: 360, height: 640 });
    await page.waitForFunction((wide) => document.querySelector("#view canvas").clientWidth !== wide, {}, wide);
    await page.waitForFunction(() => document.documentElement.scrollWidth <= innerWidth); // after layout, nothing overflows
    await page.screenshot({ path: join(folder, `${name}_narrow.png`) });
    await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: "light" }]);
    assert.notEqual(await colour(page), dark);
    assert.ok((await page.pdf({ path: join(folder, `${name}.pdf`) })).length > 10_000);
    assert.deepEqual(wrong, []);
    await page.close();
  });
}

test("the trot has a gait: a row for each foot, a line that moves, arrows while feet touch", async () => {
  const { page } = await open("trot");
  assert.equal(await page.$$eval("#gait > div", (rows) => rows.length), 4);
  const bars = await page.$$eval("#gait p", (rows) => rows.map((row) => row.querySelectorAll("i").length));
  assert.deepEqual(bars, [2, 3, 3, 2]); // each leg leaves the ground once or twice
  const cursor = () => page.$eval("#gait b", (line) => parseFloat(line.style.left));
  const before = await cursor();
  await page.$eval("#scrub", (scrub) => { scrub.value = 0.4; scrub.dispatchEvent(new Event("input")); });
  assert.ok((await cursor()) > before + 10);
  assert.equal(await page.$eval("#key-forces", (key) => key.hidden), false);
  await page.close();
});

test("a walk has plots of speeds and of ticks, and the camera follows the robot", async () => {
  const { page, wrong } = await open("walk");
  assert.deepEqual(await page.$$eval("#plot-speed, #plot-ticks", (hosts) => hosts.map((host) => [host.parentElement.hidden, !!host.querySelector("canvas")])), [[false, true], [false, true]]);
  assert.equal(await page.$$eval("#key-speed .dash", (keys) => keys.length), 3);
  assert.match(await page.$eval("#badges", (badges) => badges.textContent), /No fall in 1 s.*Largest tilt.*% over.*limits hold/);
  assert.equal(await page.$$eval("#gait > div", (rows) => rows.length), 4);
  const left = () => page.$eval("#plot-speed .u-cursor-x", (line) => line.getBoundingClientRect().left);
  const before = await left(), start = await picture(page);
  await page.$eval("#scrub", (scrub) => { scrub.value = 0.8; scrub.dispatchEvent(new Event("input")); });
  await settled(page);
  assert.ok((await left()) > before + 100);
  assert.notEqual(await picture(page), start);
  await page.screenshot({ path: join(folder, "walk.png"), fullPage: true });
  assert.deepEqual(wrong, []);
  await page.close();
});

test("a posture has the motion to it, and tells whether the target is reached", async () => {
  const { page, wrong } = await open("posture");
  assert.match(await page.$eval("#badges", (badges) => badges.textContent), /Target reached.*off.*limits of 7 of 7 positions hold/);
  assert.match(await page.$eval("#facts", (facts) => facts.textContent), /starts \d+/);
  for (const id of ["iterations", "budget"]) assert.equal(await page.$eval(`#${id}`, (part) => part.closest("section").hidden), true);
  const start = await picture(page);
  await page.$eval("#scrub", (scrub) => { scrub.value = 0.9; scrub.dispatchEvent(new Event("input")); });
  await settled(page);
  assert.notEqual(await picture(page), start);
  await page.screenshot({ path: join(folder, "posture.png"), fullPage: true });
  assert.deepEqual(wrong, []);
});

test("collision shapes are drawn when asked for, and their smallest distance has a plot", async () => {
  const { page, wrong } = await open("apart");
  const count = await page.evaluate(() => data.scene.collisions.length);
  assert.ok(count > 2, `${count} shapes`);
  assert.equal(await page.$eval("#solids", (button) => button.hidden), false);
  const before = await picture(page);
  await page.click("#solids");
  await settled(page);
  assert.equal(await page.$eval("#solids", (button) => button.getAttribute("aria-pressed")), "true");
  assert.notEqual(await picture(page), before);
  await page.screenshot({ path: join(folder, "apart.png"), fullPage: true });
  const { distances, times, text } = await page.evaluate(() => ({ distances: data.apart.distances, times: data.times, text: $("key-distance").textContent }));
  assert.equal(distances.length, times.length);
  assert.match(text, /^[\d.]+ m?m: \S+ and \S+$/);
  assert.equal(await page.$eval("#plot-distance", (plot) => plot.parentElement.hidden), false);
  await page.evaluate(() => { player.seek(data.times.at(-1)); });
  assert.notEqual(await page.$eval("#key-distance", (key) => key.textContent), text);
  assert.deepEqual(wrong, []);
  const { page: plain } = await open("reach");
  assert.equal(await plain.$eval("#plot-distance", (plot) => plot.parentElement.hidden), await plain.evaluate(() => !data.apart));
});

test("meshes of three kinds of files are drawn in their colours, where they belong", async () => {
  const { page, wrong } = await open("meshes", { width: 700, height: 600 });
  const data = await page.evaluate(() => {
    const { scene } = JSON.parse(document.getElementById("data").textContent);
    const shapes = scene.bodies.map((body) => body.shapes.filter((shape) => shape.kind === "mesh"));
    const corners = (b) => shapes[b].flatMap((shape) => cornersOf(shape, scene.meshes[shape.part]).map((p) => p.toArray()));
    const geometry = meshesOf(scene.bodies[1].shapes, scene.meshes)[0][1];
    const { position, normal } = geometry.attributes;
    // the corners lie on the box of the mesh, and each normal points away from its centre
    let outward = true;
    for (let i = 0; i < position.count; i++) outward &&= position.getX(i) * normal.getX(i) + position.getY(i) * normal.getY(i) + (position.getZ(i) - 0.2) * normal.getZ(i) > 0;
    return { counts: shapes.map((s) => s.length), corners: corners(2), vertices: position.count, outward };
  });
  assert.deepEqual(data.counts, [1, 1, 1, 0]);
  assert.equal(data.vertices, 36);
  assert.ok(data.outward, "a mirrored mesh keeps its outside");
  for (let k = 0; k < 3; k++) {
    const [least, most] = [[-0.03, -0.03, 0][k], [0.03, 0.03, 0.3][k]];
    const along = data.corners.map((corner) => corner[k]);
    assert.ok(Math.abs(Math.min(...along) - least) < 1e-6 && Math.abs(Math.max(...along) - most) < 1e-6);
  }
  await page.screenshot({ path: join(folder, "meshes.png") });
  assert.deepEqual(wrong, []);
  await page.close();
});

for (const name of ["trot", "talos"]) {
  test(`${name}: the script of a frame, measured (ms)`, { skip: !existsSync(join(folder, `${name}.html`)) }, async () => {
    const page = await browser.newPage();
    page.setDefaultTimeout(PATIENCE);
    await page.setViewport({ width: 480, height: 400 }); // small, because without a GPU the pixels of a frame take longer than its script
    // measures all callbacks that run before a frame is drawn; callbacks of one frame have the same time stamp
    await page.evaluateOnNewDocument(() => {
      window.frames_ms = new Map();
      const own = window.requestAnimationFrame.bind(window);
      window.requestAnimationFrame = (callback) => own((stamp) => {
        const begin = performance.now();
        callback(stamp);
        window.frames_ms.set(stamp, (window.frames_ms.get(stamp) ?? 0) + performance.now() - begin);
      });
    });
    await page.goto(pathToFileURL(join(folder, `${name}.html`)).href + "#t=0", { waitUntil: "load" });
    await settled(page);
    await page.evaluate(() => { window.frames_ms.clear(); document.getElementById("loop").click(); document.getElementById("play").click(); });
    const enough = page.waitForFunction(() => window.frames_ms.size > 120, { timeout: 30_000 });
    await enough.catch(() => {}); // a slow machine draws fewer frames, which are counted below
    const times = (await page.evaluate(() => [...window.frames_ms.values()])).sort((a, b) => a - b);
    const at = (share) => times[Math.min(Math.floor(share * times.length), times.length - 1)].toFixed(2);
    const triangles = await page.evaluate(() => JSON.parse(document.getElementById("data").textContent).scene.meshes.reduce((sum, mesh) => sum + numbersOf(mesh.triangles).length / 3, 0));
    console.log(`${name}: script per frame p50 ${at(0.5)} ms, p99 ${at(0.99)} ms of ${times.length} frames, ${triangles} triangles of meshes (wanted: at most 8 ms)`);
    await page.screenshot({ path: join(folder, `${name}_playing.png`) });
    assert.ok(times.length > 2, `${times.length} frames were drawn`);
    await page.close();
  });
}

test("reached bounds have a table with bars, and their multipliers have plots", async () => {
  const { page, wrong } = await open("limits", { width: 1200, height: 900 });
  const data = await page.evaluate(() => JSON.parse(document.getElementById("data").textContent));
  assert.ok(data.met.length > 0);
  assert.equal(await page.$$eval("#met tbody tr", (rows) => rows.length), data.met.length);
  const bars = await page.$$eval("#met .when", (strips) => strips.map((strip) => [...strip.querySelectorAll("i")].map((bar) => parseFloat(bar.style.left))));
  const span = data.times.at(-1) - data.times[0];
  data.met.forEach(({ knots }, i) => knots.forEach(([first], n) => assert.ok(Math.abs(bars[i][n] - (100 * data.times[first]) / span) < 1e-3)));
  for (const [id, what] of [["q", "position"], ["v", "velocity"], ["tau", "torque"]]) {
    const reached = data.met.some((met) => met.what === what);
    assert.equal(await page.$eval(`#plot-limit-${id}`, (plot) => plot.parentElement.hidden), !reached, what);
    assert.equal(await page.$$eval(`#plot-limit-${id} canvas`, (drawn) => drawn.length), reached ? 1 : 0, what);
  }
  // a click on the knot of the largest multiplier moves the robot to this knot
  await page.$eval("#met tbody button", (button) => button.click());
  assert.ok(Math.abs((await clock(page)) - data.times[data.met[0].at_knot]) < 0.006);
  await page.$eval("input[name=scale][value=share]", (input) => input.click()); // multipliers keep their units
  await page.screenshot({ path: join(folder, "limits.png"), fullPage: true });
  assert.deepEqual(wrong, []);
  await page.close();
});

test("the tables of iterations and of the budget are full", async () => {
  const { page } = await open("reach");
  assert.ok((await page.$$eval("#iterations tbody tr", (rows) => rows.length)) > 3);
  assert.equal(await page.$$eval("#budget tbody tr", (rows) => rows.length), 3);
  await page.close();
});
