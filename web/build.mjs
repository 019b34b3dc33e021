// Makes web/dist from web/src. `node build.mjs` builds, `--check` says whether dist is what src gives.
import { build } from "esbuild";
import { readFile, writeFile } from "node:fs/promises";
import { gzipSync } from "node:zlib";
import { fileURLToPath } from "node:url";
import path from "node:path";

const here = path.dirname(fileURLToPath(import.meta.url));
const result = await build({
  absWorkingDir: here,
  entryPoints: { "app": "src/app.js", "app-style": "src/app.css" },
  bundle: true,
  minify: true,
  format: "esm",
  target: ["chrome109", "firefox115", "safari16"],
  legalComments: "none",
  banner: { js: "/* Surefoot, MIT OR Apache-2.0, with uPlot and three.js (MIT; their licences are in web/dist/licences.txt). */" },
  outdir: "dist",
  write: false,
});

// Both licences ask that they come along.
const licences = await Promise.all(["uplot", "three"].map(async (name) =>
  `${name}\n\n${(await readFile(path.join(here, "node_modules", name, "LICENSE"), "utf8")).trim()}\n`));
const files = [...result.outputFiles, { path: "licences.txt", contents: Buffer.from(licences.join("\n\n")) }];

let differs = false;
let total = 0;
for (const file of files) {
  const name = path.basename(file.path).replace("app-style", "app");
  const target = path.join(here, "dist", name);
  const small = gzipSync(file.contents, { level: 6 }).length;
  if (name !== "licences.txt") total += small;
  console.log(`${name}: ${file.contents.length} bytes, ${small} gzipped`);
  if (process.argv.includes("--check")) {
    const old = await readFile(target).catch(() => Buffer.alloc(0));
    differs ||= Buffer.compare(old, Buffer.from(file.contents)) !== 0;
  } else {
    await writeFile(target, file.contents);
  }
}
console.log(`in all ${total} bytes gzipped`);
if (differs) {
  console.error("web/dist is not what web/src gives: run node build.mjs");
  process.exit(1);
}
