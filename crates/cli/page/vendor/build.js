// Makes the files beside this one from the packages in package-lock.json: `npm ci && npm run build`.
import { build } from "esbuild";
import { copyFileSync, readFileSync, writeFileSync } from "node:fs";

const version = (name) => JSON.parse(readFileSync(`node_modules/${name}/package.json`)).version;
// Every page that the program writes is a copy of these libraries, so each carries its licence along.
const licence = (name) =>
  `/*! ${name} ${version(name)}\n\n${readFileSync(`node_modules/${name}/LICENSE`, "utf8").trim()}\n*/\n`;

await build({
  entryPoints: ["three.entry.js"],
  outfile: "three.bundle.js",
  bundle: true,
  minify: true,
  format: "iife",
  globalName: "THREE",
  target: "es2020",
  legalComments: "none", // the banner has the whole text
  banner: { js: licence("three").trimEnd() },
});
for (const file of ["uPlot.iife.min.js", "uPlot.min.css"]) {
  writeFileSync(file, licence("uplot") + readFileSync(`node_modules/uplot/dist/${file}`, "utf8"));
}
for (const name of ["three", "uplot"]) copyFileSync(`node_modules/${name}/LICENSE`, `${name}.LICENSE`);
