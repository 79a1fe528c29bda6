"use strict";
// Page of a plan or of a walk: header, player, tables. `scene.js` draws the robot, `plots.js` the curves,
// `walk.js` the curves of a walk.
//
// The data are JSON, which the program writes into the script element #data. Units: SI, radians. null means missing or
// unknown; numbers that are not finite are null too. N knots have a control, N + 1 knots have a state.
//
//   robot, title      name of the robot; heading of the page
//   status            "converged", "settled" (constraints hold, the cost can hardly decrease), or the reason why the solver stopped
//   frame             name of the end-effector frame, or null
//   target            [x, y, z] that the frame should reach, m, or null
//   miss, tolerance   distance at the last knot, and distance that counts as reached, m, or null
//   dt, times         step (s); [N + 1] times of the knots (s), increasing
//   joints            [J] of { name, unit: "rad" | "m", lower, upper, velocity, effort_lower, effort_upper }: one per
//                     shown coordinate of v, with its limits, each of which may be null (|v| ≤ velocity)
//   q, v, tau         [N + 1][J], [N + 1][J], [N][J]: rad, rad/s, N·m, or m, m/s, N
//   iterations        [] of { iteration, cost, gap, step, regularisation, stop }; step and stop may be null
//   budget            { budget_ms, knots, per, rows: [] of { name, us_per_knot, ms_per_horizon }, total_ms,
//                     alone: [] of the same, functions measured alone, not part of the total }, or null;
//                     `per`: what is measured ("one solver iteration"); budget_ms null: no budget
//   scene.bodies      [B] of { name, parent (index, −1 for the world), shapes: [] of { kind, size, position [3],
//                     quaternion [x, y, z, w], color "#rrggbb" } }; position and quaternion: pose in the body, null for
//                     the identity; color null: the page's colour for bones and joints, light or dark. size by kind:
//                       box [x, y, z] · sphere [radius] · cylinder [radius, length], axis z ·
//                       capsule [radius, length of its straight part], axis z · segment [from (3), to (3), radius] ·
//                       mesh [scale along x, y, z], with `part`, its index in scene.meshes
//   scene.collisions  [] of { body (index), kind, size, position [3], quaternion [4] }: collision shapes, as in scene.bodies;
//                     kind also "ellipsoid" [semi-axes x, y, z]; missing without shapes
//   apart             { distances [N + 1], nearest [N + 1], pairs: [] of [name, name] }: smallest distance (m) of all pairs of
//                     collision shapes, and index of the nearest pair; null without pairs
//   scene.meshes      [] of { low [3], side [3], points, triangles }: bounding box of a part of a mesh, its points (three
//                     numbers each, point = low + side n / 65535) and the corners of its triangles, as base64 of
//                     16-bit numbers
//   scene.poses       [N + 1][B][7]: pose of each body in the world, px py pz qx qy qz qw
//   scene.trail       [N + 1][3]: position of the end-effector in the world, or null
//   contacts          { feet: [F] names, trails: [F][N + 1][3] (m), touches: [N][F], forces: [N][F] of [3] (N) or null if
//                     the foot does not touch, weight: weight of the robot (N) }, or null, or missing; along the world's axes
//   limits            { source, positions, velocities, efforts, of }: source of the limits, number of limited coordinates of
//                     each kind, and number of degrees of freedom of the robot
//   violations        [] of { what: "position" | "velocity" | "torque", joint (its name), at_knot, amount, limit }: the
//                     worst knot of each joint and quantity that exceeds a limit; the excess, and the exceeded limit
//   met               [] of { what, joint, bound: "lower" | "upper", limit, knots: [] of [first, last], multiplier, at_knot }:
//                     each bound that the motion reaches, the knots at the bound, the multiplier with the largest absolute
//                     value (cost per unit) and its knot; multiplier null: the solver did not need the limits
//   multipliers       { q, v, tau }: multipliers of the limits, in the shapes of q, v and tau above, null for joints that
//                     reach no bound; each may be null, if no bound of the quantity is reached; or null
//   worst             { text, is_gap } of the row that an unsolved problem violates most, or null; is_gap: the row belongs
//                     to the dynamics
//   scene.follow      index of the body that the camera follows; missing: the camera stays
//   walk              { gait, seconds (requested), command [3], mean [3], since (s), velocities, commands: [N][3], ticks: { times,
//                     ms, budget_ms, over }, tilt (rad), fall: { time, what } or null }: a walk in the simulation; velocities
//                     along the heading: forwards, to the left (m/s), turning (rad/s); missing for a plan
//   posture           { reached, rotation (error in rad, or null), starts, held: [] of what holds the posture back, in words }:
//                     the motion ends at a posture that was searched; missing for plans and walks
//   version, command  version of the program that wrote the page; its command line, or null
//
// `#t=0.4` in the address opens the page paused at 0.4 s. While the player is paused, the address shows its time.

const UNITS_NOTE = "Dashed lines are limits, in the colour of their joint. Limits far from the curves are not shown.";

const $ = (id) => document.getElementById(id);
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** Formats a number for readers: a few significant digits, a typographic minus, powers of ten. */
function number(x, digits = 4) {
  if (x == null) return "–";
  if (x === 0) return "0";
  const size = Math.abs(x);
  if (size >= 1e-3 && size < 1e5) return x.toFixed(Math.min(Math.max(digits - 1 - Math.floor(Math.log10(size)), 0), 5)).replace("-", "−");
  const [mantissa, exponent] = x.toExponential(Math.min(digits, 3) - 1).split("e");
  return `${mantissa}·10${superscript(Number(exponent))}`.replace("-", "−");
}
/** Formats a number without trailing zeros, for use in a sentence. */
const brief = (x, digits = 3) => number(x, digits).replace(/(\.\d*?)0+(?=$|·)/, "$1").replace(/\.(?=$|·)/, "");
const length = (metres) => (metres == null ? "–" : metres < 0.1 ? `${brief(1000 * metres)} mm` : `${brief(metres)} m`);

/** Returns the knot at or before time t, and the fraction of the interval to the next knot. */
function knotAt(times, t) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    times[middle] <= t + 1e-12 ? (low = middle) : (high = middle - 1);
  }
  const step = times[low + 1] - times[low];
  return { k: low, s: step > 0 ? Math.min(Math.max((t - times[low]) / step, 0), 1) : 0 };
}

/** Creates an element with attributes and children; text is never parsed as HTML. */
function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) key === "style" ? (made.style.cssText = value) : made.setAttribute(key, value);
  made.append(...children);
  return made;
}

function header(data) {
  document.title = `${data.title} · Condyle`;
  $("title").textContent = data.title;
  const last = data.times.at(-1) - data.times[0];
  const fact = (name, value) => element("span", {}, `${name} `, element("b", {}, value));
  const knots = data.times.length - 1;
  if (!data.walk) $("facts").append(
    fact("robot", data.robot),
    ...(data.frame ? [fact("end-effector", data.frame)] : []),
    ...(data.target ? [fact("target", `(${data.target.map((x) => x.toFixed(3).replace("-", "−")).join(", ")}) m`)] : []),
    fact("horizon", `${knots} × ${brief(1000 * data.dt)} ms = ${brief(last)} s`),
    data.posture ? fact("starts", String(data.posture.starts)) : fact("iterations", String(data.iterations.at(-1)?.iteration ?? 0)),
  );

  const badge = (state, text) => {
    const path = { good: "m5 13 4 4L19 7", warn: "M12 6v8M12 18.5v.1", bad: "m6 6 12 12M18 6 6 18" }[state];
    const item = element("li", { class: state });
    item.innerHTML = `<svg viewBox="0 0 24 24" aria-hidden="true"><path d="${path}"/></svg>`;
    item.append(text);
    $("badges").append(item);
  };
  if (data.walk) {
    $("kind").textContent = "walk";
    walkHeader(data, fact, badge);
    limitsBadge(data, badge);
    return footer(data);
  }
  if (data.posture) {
    $("kind").textContent = "posture";
    const { reached, rotation, held } = data.posture;
    const off = `${length(data.miss)}${rotation == null ? "" : ` and ${number(rotation, 2)} rad`} off`;
    badge(reached ? "good" : "bad", `${reached ? "Target reached" : "Target missed"}: ${off}`);
    for (const limit of held) badge("warn", `Held back by the ${limit.replaceAll("`", "")}`);
    if (data.limits.positions) badge("good", `The limits of ${data.limits.positions} of ${data.limits.of} positions hold`);
    else badge("warn", `No limits of positions: ${data.limits.source} has none`);
    return footer(data);
  }
  const solved = { converged: "Converged", settled: "Settled: constraints hold, the cost hardly decreases" }[data.status];
  badge(solved ? "good" : "bad", solved ?? `Not converged: ${data.status}`);
  if (data.worst) badge("bad", data.worst.text[0].toUpperCase() + data.worst.text.slice(1));
  if (data.miss != null) {
    const reached = data.tolerance == null || data.miss <= data.tolerance;
    const within = data.tolerance == null ? "" : reached ? ` (within ${length(data.tolerance)})` : ` (more than ${length(data.tolerance)})`;
    badge(reached ? "good" : "bad", `${reached ? "Target reached" : "Target missed"}: ${length(data.miss)} off${within}`);
  }
  if (data.budget?.budget_ms != null) {
    const { total_ms: total, budget_ms: budget } = data.budget;
    badge(total <= budget ? "good" : "warn", `${total <= budget ? "Within" : "Over"} budget: ${brief(total)} of ${brief(budget)} ms`);
  }
  limitsBadge(data, badge);
  footer(data);
}

function limitsBadge(data, badge) {
  const breaches = data.violations.length, { source, positions, velocities, efforts, of } = data.limits;
  const total = positions + velocities + efforts;
  const kinds = `${positions} of ${of} positions, ${velocities} of ${of} velocities, ${efforts} of ${of} efforts`;
  if (!total) badge("warn", `No limits checked: ${source} has none`);
  else if (breaches) badge("bad", `${breaches} of ${total} limits exceeded (${source}: ${kinds})`);
  else if (data.worst?.is_gap) badge("warn", `The limits hold, but the motion does not follow the dynamics (${source}: ${kinds})`);
  else badge("good", `${total === 1 ? "1 limit holds" : `All ${total} limits hold${data.worst ? " up to rounding" : ""}`} (${source}: ${kinds})`);
}

function footer(data) {
  $("footer").append("Made by Condyle", data.version ? ` ${data.version}` : "", ...(data.command ? [" with ", element("code", {}, data.command)] : []), ". Drawn with three.js and uPlot (MIT).");
}

function budgetTable({ budget_ms: budget, knots, per, rows, alone, total_ms: total }) {
  const listed = rows.reduce((sum, row) => sum + row.ms_per_horizon, 0);
  const sum = $("budget-sum");
  sum.append(per ? `${per}: ` : "", element("b", {}, `${brief(total)} ms`), budget == null ? "" : ` of ${brief(budget)} ms (${brief((100 * total) / budget, 2)} %)`);
  const full = Math.max(total, listed, budget ?? 0), widest = Math.max(...rows.map((row) => row.us_per_knot));
  const bar = $("budget-bar"), body = $("budget").tBodies[0];
  const scale = (ms) => (100 * ms) / full;
  let from = 0;
  rows.forEach((row, i) => {
    const tint = `--tint: var(--hue-${i % HUES.light.length})`;
    bar.append(element("i", { style: `${tint}; left: ${scale(from)}%; width: ${scale(row.ms_per_horizon)}%`, title: `${row.name}: ${number(row.ms_per_horizon, 3)} ms` }));
    from += row.ms_per_horizon;
    body.append(element("tr", { style: tint },
      element("th", { scope: "row" }, element("span", { class: "chip" }), row.name),
      element("td", { class: "n" }, number(row.us_per_knot, 3)),
      element("td", { class: "meter" }, element("i", { style: `width: ${(100 * row.us_per_knot) / widest}%` })),
      element("td", { class: "n" }, number(row.ms_per_horizon, 3)),
      element("td", { class: "n" }, budget == null ? "–" : `${number((100 * row.ms_per_horizon) / budget, 2)} %`)));
  });
  if (budget != null) {
    const mark = element("b", { style: `left: calc(${scale(budget)}% - 1px)` }, element("span", {}, `budget ${brief(budget)} ms`));
    if (scale(budget) < 25) mark.firstChild.style.cssText = "right: auto; left: 0";
    bar.append(mark);
  }
  bar.setAttribute("aria-label", `${brief(total)} ms${budget == null ? "" : ` of a budget of ${brief(budget)} ms`}; the table below has the phases.`);
  const line = (name, ms) => element("tr", {}, element("td", {}, name), element("td", { class: "n" }, number((1000 * ms) / knots, 3)), element("td", { class: "meter" }),
    element("td", { class: "n" }, number(ms, 3)), element("td", { class: "n" }, budget == null ? "–" : `${number((100 * ms) / budget, 2)} %`));
  $("budget").tFoot.append(line("total", total), ...(budget == null ? [] : [line("budget", budget)]));
  for (const row of alone ?? []) {
    const timed = line(`${row.name}, alone`, row.ms_per_horizon);
    timed.className = "alone";
    $("budget").tFoot.append(timed);
  }
}

function iterationTable(iterations) {
  for (const row of iterations) {
    $("iterations").tBodies[0].append(element("tr", {}, ...[String(row.iteration), number(row.cost, 6), number(row.gap, 3), number(row.step, 3), number(row.regularisation, 3), number(row.stop, 3)]
      .map((text) => element("td", { class: "n" }, text))));
  }
}

function iterationLine(row) {
  const part = (name, value) => [` · ${name} `, element("b", {}, value)];
  $("iteration").replaceChildren("iteration ", element("b", {}, String(row.iteration)), ...part("cost", brief(row.cost, 6)), ...part("gap", brief(row.gap)),
    ...part("step", brief(row.step)), ...part("regularisation", brief(row.regularisation)), ...part("stop", brief(row.stop)));
}

/** Makes the table of joints: legend of the plots, a switch for each curve, and the numbers at the playback time. */
function makeJoints(data, plots, focus) {
  const shown = new Set(data.joints.keys());
  const body = $("joints").querySelector("tbody");
  const rows = data.joints.map((joint, j) => {
    const button = element("button", { type: "button", title: "Show or hide; double-click: show only this one" }, element("span", { class: "chip" }), joint.name);
    const cells = plots.quantities.map(() => element("td", { class: "n" }, element("span"), element("i")));
    const row = element("tr", {}, element("th", { scope: "row" }, button), ...cells);
    row.addEventListener("pointerenter", () => focus(j));
    row.addEventListener("pointerleave", () => focus(null));
    button.addEventListener("focus", () => focus(j));
    button.addEventListener("blur", () => focus(null));
    button.addEventListener("click", () => { shown.has(j) ? shown.delete(j) : shown.add(j); apply(); });
    button.addEventListener("dblclick", () => { shown.clear(); shown.add(j); apply(); });
    body.append(row);
    return { row, button, cells };
  });
  $("all").addEventListener("click", () => {
    const every = shown.size === 0;
    shown.clear();
    if (every) for (const j of data.joints.keys()) shown.add(j);
    apply();
  });
  function apply() {
    rows.forEach(({ row, button }, j) => {
      row.classList.toggle("off", !shown.has(j));
      button.setAttribute("aria-pressed", shown.has(j));
    });
    $("all").textContent = shown.size === 0 ? "Show all" : "Hide all";
    plots.filter((j) => shown.has(j));
  }
  function recolour() {
    rows.forEach(({ row }, j) => {
      const { colour, dash } = strokeOf(j);
      row.style.setProperty("--tint", colour);
      row.querySelector(".chip").style.borderTop = `3.5px ${dash.length ? "dashed" : "solid"} ${colour}`;
    });
  }
  // A cell is written only if its content changes, because most of a robot's joints are at rest.
  let at = -1;
  const written = rows.map(() => plots.quantities.map(() => ({ text: null, share: null })));
  function show(k) {
    if (k === at) return;
    at = k;
    rows.forEach(({ cells }, j) => plots.quantities.forEach((quantity, i) => {
      const joint = data.joints[j], value = plots.valueAt(quantity, k, j), size = Math.abs(shareOf(value, quantity.limits(joint)) ?? 0);
      const cell = cells[i], last = written[j][i], share = Math.min(size, 1).toFixed(3);
      const digits = joint.unit === "m" && i < 2 ? 4 : Math.abs(value) >= 10 ? 2 : 3;
      const text = value == null ? "–" : value.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "−");
      if (text !== last.text) cell.firstChild.textContent = last.text = text;
      cell.classList.toggle("over", size > 1 + 1e-6);
      if (share !== last.share) cell.lastChild.style.setProperty("--share", last.share = share);
    }));
  }
  // The tooltip of a cell is made when the pointer enters it.
  rows.forEach(({ cells }, j) => cells.forEach((cell, i) => cell.addEventListener("pointerenter", () => {
    const quantity = plots.quantities[i], joint = data.joints[j], share = shareOf(plots.valueAt(quantity, at, j), quantity.limits(joint));
    cell.title = `${quantity.unit(joint.unit)}${share == null ? "" : `, ${Math.round(100 * Math.abs(share))} % of the way to its limit`}`;
  })));
  // The header names the units, so that each number has one.
  const units = [...new Set(data.joints.map((joint) => joint.unit))];
  plots.quantities.forEach((quantity, i) => {
    $("joints").tHead.rows[0].cells[i + 1].append(" ", element("small", {}, units.map(quantity.unit).join(", ")));
  });
  apply();
  recolour();
  return { show, recolour, reveal(j) { shown.add(j); apply(); }, mark(j) { rows.forEach(({ row }, i) => row.classList.toggle("focus", i === j)); } };
}

function violationTable(data, quantities, go) {
  if (!data.violations.length) return;
  $("violations").hidden = false;
  for (const { what, joint, at_knot: k, amount, limit } of data.violations) {
    const unit = quantities.find((quantity) => quantity.what === what)?.unit(data.joints.find((j) => j.name === joint)?.unit ?? "") ?? "";
    const button = element("button", { type: "button", class: "quiet" }, `knot ${k}, ${brief(data.times[k])} s`);
    button.addEventListener("click", () => go(k, data.joints.findIndex((j) => j.name === joint)));
    $("violations").querySelector("tbody").append(element("tr", {}, element("th", { scope: "row" }, what), element("td", {}, joint ?? "–"),
      element("td", { class: "n" }, `${brief(amount)} ${unit}`), element("td", { class: "n" }, `${brief(limit)} ${unit}`), element("td", { class: "n" }, button)));
  }
}

/** Fills the table of reached bounds, with bars over time that show when each bound is reached. */
function metTable(data, quantities, go) {
  if (!data.met?.length) return;
  $("met").hidden = false;
  const { times } = data, start = times[0], span = times.at(-1) - start || 1;
  for (const { what, joint, bound, limit, knots, multiplier, at_knot: k } of data.met) {
    const quantity = quantities.find((q) => q.what === what), j = data.joints.findIndex((one) => one.name === joint);
    const unit = quantity.unit(data.joints[j]?.unit ?? "");
    const seconds = (k) => times[Math.min(k, times.length - 1)];
    const strip = element("p", { class: "when" });
    for (const [first, last] of knots) {
      // a torque acts until the next knot
      const from = seconds(first), to = seconds(quantity.held ? last + 1 : last);
      const title = to > from ? `${brief(from)} to ${brief(to)} s (knots ${first} to ${last})` : `${brief(from)} s (knot ${first})`;
      strip.append(element("i", { title, style: `left: ${(100 * (from - start)) / span}%; width: ${(100 * (to - from)) / span}%; --tint: var(--hue-${Math.max(j, 0) % HUES.light.length})` }));
    }
    const button = element("button", { type: "button", class: "quiet" }, `knot ${k}, ${brief(seconds(k))} s`);
    button.addEventListener("click", () => go(k, j));
    $("met").querySelector("tbody").append(element("tr", {}, element("th", { scope: "row" }, what), element("td", {}, joint), element("td", {}, bound),
      element("td", { class: "n" }, `${brief(limit)} ${unit}`), element("td", { class: "meter" }, strip), element("td", { class: "n" }, multiplier == null ? "–" : number(multiplier, 3)), element("td", { class: "n" }, button)));
  }
}

/** Draws the gait: bars over time that show when each foot touches. Returns a function that moves the playback line. */
function makeGait({ times, contacts }) {
  if (!contacts) return { show() {} };
  const host = $("gait"), start = times[0], span = times.at(-1) - start || 1;
  const share = (t) => (100 * (t - start)) / span;
  const cursors = contacts.feet.map((foot, f) => {
    const strip = element("p");
    for (let k = 0; k < contacts.touches.length; k++) {
      if (!contacts.touches[k][f] || contacts.touches[k - 1]?.[f]) continue;
      let end = k;
      while (end < contacts.touches.length && contacts.touches[end][f]) end++;
      strip.append(element("i", { style: `left: ${share(times[k])}%; width: ${share(times[end]) - share(times[k])}%`, title: `${foot} touches from ${times[k].toFixed(2)} to ${times[end].toFixed(2)} s` }));
    }
    const cursor = element("b");
    strip.append(cursor);
    host.append(element("div", {}, element("span", { title: foot }, foot), strip));
    return cursor;
  });
  host.setAttribute("aria-label", `When each of ${contacts.feet.length} feet touches the ground`);
  host.hidden = false;
  return { show(t) { for (const cursor of cursors) cursor.style.left = `${share(t)}%`; } };
}

/** Makes the player: it plays, pauses under the pointer, and steps. It calls `show(t)` to update all views. */
function makePlayer(times, show) {
  const start = times[0], end = times.at(-1), scrub = $("scrub"), play = $("play");
  const seconds = element("b"), knot = element("span");
  $("clock").replaceChildren(seconds, ` / ${end.toFixed(2)} s`, knot);
  let t = start, playing = false, held = false, before = null, next = null;
  Object.assign(scrub, { min: start, max: end, step: times.length > 1 ? (end - start) / (times.length - 1) : 1 });

  function seek(to) {
    t = Math.min(Math.max(to, start), end);
    const { k } = knotAt(times, t);
    scrub.value = t;
    scrub.setAttribute("aria-valuetext", `${t.toFixed(2)} seconds, knot ${k} of ${times.length - 1}`);
    seconds.textContent = t.toFixed(2);
    knot.textContent = ` · knot ${k}`;
    show(t);
    if (!playing) remember();
  }
  // The address contains the time at which the player is paused, so that users can share it.
  let later = null;
  function remember() {
    clearTimeout(later);
    later = setTimeout(() => {
      const hash = `#t=${Number(t.toFixed(4))}`;
      if (!playing && location.hash !== hash) history.replaceState(null, "", hash);
    }, 150);
  }
  function frame(stamp) {
    if (!playing) return;
    if (before != null && !held) {
      // after a hidden page or a slow frame, playback continues without a jump
      let to = t + (Math.min(stamp - before, 250) / 1000) * Number($("speed").value);
      if (to >= end) {
        if ($("loop").getAttribute("aria-pressed") === "true") to = start + ((to - end) % (end - start || 1));
        else run(false);
      }
      seek(to);
    }
    before = stamp;
    next = requestAnimationFrame(frame);
  }
  function run(yes) {
    if (yes && !playing) {
      if (t >= end - 1e-9) seek(start);
      before = null;
      cancelAnimationFrame(next);
      next = requestAnimationFrame(frame);
    }
    playing = yes;
    if (!yes) remember();
    play.classList.toggle("playing", yes);
    play.setAttribute("aria-label", yes ? "Pause" : "Play");
  }
  function step(by) {
    run(false);
    const { k, s } = knotAt(times, t);
    seek(times[Math.min(Math.max(by < 0 && s > 1e-9 ? k : k + by, 0), times.length - 1)]);
  }
  play.addEventListener("click", () => run(!playing));
  $("back").addEventListener("click", () => step(-1));
  $("forth").addEventListener("click", () => step(1));
  scrub.addEventListener("input", () => { run(false); seek(Number(scrub.value)); });
  $("loop").addEventListener("click", ({ currentTarget: loop }) => loop.setAttribute("aria-pressed", loop.getAttribute("aria-pressed") !== "true"));
  // A control with focus keeps its own keys.
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.shiftKey) return;
    const on = event.target.closest?.("button, select, summary, a, input")?.matches("input[type=range]") ? "range" : event.target.closest?.("button, select, summary, a, input") ? "control" : "page";
    if (event.key === " " && on !== "control") run(!playing);
    else if (event.key === "ArrowLeft" && on !== "range" && !event.target.matches("select, input")) step(-1);
    else if (event.key === "ArrowRight" && on !== "range" && !event.target.matches("select, input")) step(1);
    else return;
    event.preventDefault();
  });
  return { seek, run, hold(yes) { held = yes; before = null; }, pause() { run(false); } };
}

const data = JSON.parse($("data").textContent);
header(data);
const hues = () => { for (let i = 0; i < HUES.light.length; i++) document.documentElement.style.setProperty(`--hue-${i}`, strokeOf(i).colour); };
hues();

$("key-target").hidden = !data.target;
$("key-trail").hidden = !data.scene.trail;
$("key-feet").hidden = $("key-forces").hidden = !data.contacts;
let view = null;
try {
  view = makeScene(data, $("view"));
} catch (error) {
  // No WebGL, or not enough memory: the rest of the page works without it.
  console.warn(error);
  for (const part of $("view").children) part.hidden = part.id !== "view-note";
  $("view-note").hidden = false;
  $("view-note").textContent = "The 3-D view needs WebGL, which this browser does not have. The plots, the table and the time slider work without it.";
}

const focus = (j) => { plots.focus(j); joints.mark(j); };
const plots = makePlots(data, { seek: (t) => player.seek(t), hold: (yes) => player.hold(yes), focus });
const walkPlots = data.walk && makeWalkPlots(data, { seek: (t) => player.seek(t), hold: (yes) => player.hold(yes) });
const distancePlot = data.apart && makeDistancePlot(data, { seek: (t) => player.seek(t), hold: (yes) => player.hold(yes) });
const joints = makeJoints(data, plots, focus);
const gait = makeGait(data);
const player = makePlayer(data.times, (t) => {
  const { k, s } = knotAt(data.times, t);
  view?.show(k, s);
  plots.show(t);
  walkPlots?.show(t);
  distancePlot?.show(t);
  joints.show(k);
  gait.show(t);
});
const go = (k, j) => {
  player.pause();
  player.seek(data.times[k]);
  if (j >= 0) joints.reveal(j);
  $("plots").scrollIntoView({ behavior: "smooth", block: "nearest" });
};
violationTable(data, plots.quantities, go);
metTable(data, plots.quantities, go);

let progress = null;
if (data.iterations.length) {
  iterationTable(data.iterations);
  const pick = (i) => iterationLine(data.iterations[i] ?? data.iterations.at(-1));
  if (data.iterations.length > 1) progress = makeProgress(data.iterations, { pick });
  iterationLine(data.iterations.at(-1));
} else $("iterations").closest("section").hidden = true;
if (data.budget) budgetTable(data.budget);
else $("budget").closest("section").hidden = true;

$("limits-note").textContent = UNITS_NOTE;
$("reset").addEventListener("click", () => view?.reset());
$("solids").hidden = !view || !data.scene.collisions?.length;
$("solids").addEventListener("click", ({ currentTarget: button }) => {
  const on = button.getAttribute("aria-pressed") !== "true";
  button.setAttribute("aria-pressed", on);
  button.title = `${on ? "Hide" : "Show"} the collision shapes`;
  button.setAttribute("aria-label", button.title);
  view.showSolids(on);
});
for (const input of document.querySelectorAll("input[name=scale]")) {
  input.addEventListener("change", () => {
    plots.scale(input.value === "share");
    $("limits-note").textContent = input.value === "share"
      ? "0 % is the middle between the limits, ±100 % are the limits. Joints without limits are not drawn."
      : UNITS_NOTE;
  });
}
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  hues();
  view?.recolour();
  plots.rebuild();
  walkPlots?.rebuild();
  distancePlot?.rebuild();
  progress?.rebuild();
  joints.recolour();
});

const timeOf = (hash) => /[#&]t=([\d.]+)/.exec(hash);
addEventListener("hashchange", () => {
  const asked = timeOf(location.hash);
  if (asked) { player.pause(); player.seek(Number(asked[1])); }
});
addEventListener("beforeprint", () => view?.draw());
const at = timeOf(location.hash);
player.seek(at ? Number(at[1]) : data.times[0]);
// The motion plays once automatically, unless the user's system requests reduced motion.
if (!at && !matchMedia("(prefers-reduced-motion: reduce)").matches) player.run(true);
