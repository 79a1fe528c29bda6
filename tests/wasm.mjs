// Runs the example `numbers` as a WebAssembly module in Node.js or headless Chromium, and prints its output:
//
//     node tests/wasm.mjs MODULE.wasm baseline|simd128 [chromium]
//
// tests/page/run.sh installs Chromium; CHROMIUM names another browser.
import { existsSync } from "node:fs";
import { readFile } from "node:fs/promises";
import { createRequire } from "node:module";
import { fileURLToPath } from "node:url";

/** Runs a module, given as base64, with or without SIMD128. The function works in Node.js and in a browser's page. */
async function run(module, vectors) {
  const bytes = Uint8Array.from(atob(module), (c) => c.charCodeAt(0));
  let said = "", memory;
  const take = (text, length) => { said += new TextDecoder().decode(new Uint8Array(memory.buffer, text, length)); };
  const page = { vectors: () => vectors, now: () => performance.now(), take };
  const { instance } = await WebAssembly.instantiate(bytes, { page });
  memory = instance.exports.memory;
  try {
    instance.exports.main(0, 0);
    return { right: true, said };
  } catch (trap) {
    return { right: false, said: `${trap}: ${said}\n` };
  }
}

const [file, level, browser] = process.argv.slice(2);
const module = (await readFile(file)).toString("base64");
const vectors = Number(level === "simd128");
let result;
if (browser) {
  const require = createRequire(fileURLToPath(new URL("../.venv/page/package.json", import.meta.url)));
  const own = ["/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find(existsSync);
  const bundled = async () => (await import(require.resolve("@sparticuz/chromium"))).default.executablePath();
  const { default: puppeteer } = await import(require.resolve("puppeteer-core"));
  const chromium = await puppeteer.launch({
    executablePath: process.env.CHROMIUM ?? own ?? (await bundled()), headless: "shell", args: ["--no-sandbox"],
  });
  try {
    const page = await chromium.newPage();
    result = await page.evaluate(`(${run})("${module}", ${vectors})`);
  } finally {
    await chromium.close();
  }
} else {
  result = await run(module, vectors);
}
process.stdout.write(result.said);
process.exitCode = result.right ? 0 : 1;
