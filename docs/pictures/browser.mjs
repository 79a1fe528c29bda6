// Takes a picture of a page that draws with WebGL: node docs/pictures/browser.mjs URL FILE.png SECONDS
//
// Uses the browser that tests/page/run.sh installs into .venv/page.
import { createRequire } from "node:module";
import { join } from "node:path";

const [url, file, seconds] = process.argv.slice(2);
const from = createRequire(join(import.meta.dirname, "../../.venv/page/package.json"));
const puppeteer = from("puppeteer-core");
const { default: chromium } = await import(from.resolve("@sparticuz/chromium"));
const browser = await puppeteer.launch({
  executablePath: process.env.CHROMIUM ?? (await chromium.executablePath()),
  headless: "shell",
  env: { ...process.env, LC_ALL: "en_US.UTF-8", LANG: "en_US.UTF-8", LANGUAGE: "en" },
  protocolTimeout: 600_000, // without a GPU a picture may take minutes
  args: ["--no-sandbox", "--lang=en-US", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"],
});
const page = await browser.newPage();
page.on("pageerror", (error) => console.error(error.message));
await page.setViewport({ width: 900, height: 480 });
await page.goto(url, { waitUntil: "domcontentloaded", timeout: 300_000 });
await new Promise((done) => setTimeout(done, 1000 * Number(seconds)));
await page.evaluate(() => document.querySelectorAll("[class*=Notification-closeButton]").forEach((button) => button.click()));
await new Promise((done) => setTimeout(done, 5000));
await page.screenshot({ path: file });
await browser.close();
