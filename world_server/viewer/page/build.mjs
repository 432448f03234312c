// SPDX-License-Identifier: MIT
// Bundles the page and writes it as a C++ source file: page_files.h says what is in there.
// usage: node build.mjs FOLDER_WITH_NODE_MODULES OUTPUT.cpp
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { dirname, join, resolve } from "node:path";
import { fileURLToPath } from "node:url";

const [installed, output] = process.argv.slice(2).map((path) => resolve(path));
const page = dirname(fileURLToPath(import.meta.url));
const esbuild = createRequire(join(installed, "package.json"))("esbuild");

const { outputFiles } = esbuild.buildSync({
  entryPoints: [join(page, "src/main.js")],
  bundle: true,
  minify: true,
  format: "esm",
  charset: "ascii",
  legalComments: "inline",
  nodePaths: [join(installed, "node_modules")],
  logLevel: "warning",
  write: false,
});

const files = [
  ["/", "text/html; charset=utf-8", readFileSync(join(page, "index.html"), "utf8")],
  ["/style.css", "text/css; charset=utf-8", readFileSync(join(page, "style.css"), "utf8")],
  ["/viewer.js", "text/javascript; charset=utf-8", outputFiles[0].text],
];

// A raw literal in pieces of at most 8000 characters, which every compiler takes.
const literal = (text) =>
  (text.match(/[^]{1,8000}/g) ?? [""]).map((piece) => `R"rikiseki(${piece})rikiseki"`).join("\n");

writeFileSync(
  output,
  `// Written by world_server/viewer/page/build.mjs.
#include "world_server/viewer/page_files.h"

namespace rikiseki::viewer {
namespace {
${files.map(([, , text], i) => `constexpr char kFile${i}[] = ${literal(text)};`).join("\n")}
constexpr PageFile kFiles[] = {
${files.map(([path, type], i) => `  {"${path}", "${type}", {kFile${i}, sizeof kFile${i} - 1}},`).join("\n")}
};
}  // namespace
std::span<const PageFile> PageFiles() { return kFiles; }
}  // namespace rikiseki::viewer
`,
);
