// Builds the page: `npm ci && npm run build`. The files of dist/ are part of the program, and of the repository, so that
// building the program needs neither Node nor the network.

import { build } from "esbuild";
import { mkdirSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const here = dirname(fileURLToPath(import.meta.url));
const dist = process.argv[2] ?? join(here, "dist");
mkdirSync(dist, { recursive: true });

const { metafile } = await build({
  absWorkingDir: here,
  entryPoints: { page: "src/page.js" },
  outdir: dist,
  bundle: true,
  minify: true,
  format: "esm",
  target: "es2022",
  legalComments: "none",
  metafile: true,
  logLevel: "warning",
});

const style = await build({
  absWorkingDir: here,
  entryPoints: ["page.css"],
  bundle: true,
  minify: true,
  write: false,
  logLevel: "warning",
});
// One style sheet: the one of the plots, imported by the modules, and the page's own.
const plots = readFileSync(join(dist, "page.css"), "utf8");
writeFileSync(join(dist, "page.css"), plots + style.outputFiles[0].text);
writeFileSync(join(dist, "index.html"), readFileSync(join(here, "index.html")));

// The licences of all packages in the bundle: the file of the package, or else the one in licences/.
const names = new Set();
for (const input of Object.keys(metafile.inputs)) {
  const path = input.split("node_modules/").at(-1);
  if (path === input) continue;
  const [scope, name] = path.split("/");
  names.add(scope.startsWith("@") ? `${scope}/${name}` : scope);
}
const line = "=".repeat(100);
let licences = "The page of motorium view contains the following packages.\n";
for (const name of [...names].sort()) {
  const folder = join(here, "node_modules", name);
  const { version, license } = JSON.parse(readFileSync(join(folder, "package.json"), "utf8"));
  const own = readdirSync(folder).find((file) => /^licen[cs]e(\.(md|txt))?$/i.test(file));
  const file = own ? join(folder, own) : join(here, "licences", `${name.replace("/", "+")}.txt`);
  licences += `\n${line}\n${name} ${version}, ${license}\n\n${readFileSync(file, "utf8").trim()}\n`;
}
const apache = readFileSync(join(here, "licences", "apache-2.0.txt"), "utf8").trim();
licences += `\n${line}\n\n${apache}\n`;
writeFileSync(join(dist, "licences.txt"), licences.replaceAll("\r\n", "\n"));
