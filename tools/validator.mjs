// The Khronos glTF validator over files.
//
//   node tools/validator.mjs FILE...           prints errors and warnings; exit 1 on any error
//   node tools/validator.mjs --compare IN OUT  exit 1 if OUT has an error, or a kind of warning more often than IN
//
// The validator is an npm package. It is looked for in $GLTF_VALIDATOR (a folder with node_modules), else installed
// into the system's folder for temporary files.

import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { dirname, join, resolve } from "node:path";

const VERSION = "2.0.0-dev.3.10";

function load() {
  const home = process.env.GLTF_VALIDATOR ?? join(tmpdir(), `gltf-validator-${VERSION}`);
  if (!existsSync(join(home, "node_modules", "gltf-validator"))) {
    mkdirSync(home, { recursive: true });
    const arguments_ = ["install", "--silent", "--no-audit", "--no-fund", "--prefix", home, `gltf-validator@${VERSION}`];
    execFileSync("npm", arguments_, { stdio: ["ignore", "ignore", "inherit"] });
  }
  return createRequire(join(resolve(home), "package.json"))("gltf-validator");
}

const validator = load();

/** Errors and warnings of one file. */
async function issues(file) {
  const report = await validator.validateBytes(new Uint8Array(readFileSync(file)), {
    uri: file,
    maxIssues: 0,
    externalResourceFunction: async (uri) =>
      new Uint8Array(readFileSync(join(dirname(file), decodeURIComponent(uri)))),
  });
  const messages = report.issues.messages;
  return { errors: messages.filter((m) => m.severity === 0), warnings: messages.filter((m) => m.severity === 1) };
}

function print(file, { errors, warnings }) {
  for (const [word, list] of [["error", errors], ["warning", warnings]]) {
    for (const m of list) console.log(`${file}: ${word}: ${m.code} ${m.pointer ?? ""}: ${m.message}`);
  }
  console.log(`${file}: ${errors.length} errors, ${warnings.length} warnings`);
}

function counted(list) {
  const count = new Map();
  for (const m of list) count.set(m.code, (count.get(m.code) ?? 0) + 1);
  return count;
}

const files = process.argv.slice(2);
if (files[0] === "--compare" && files.length === 3) {
  const [before, after] = [await issues(files[1]), await issues(files[2])];
  print(files[2], after);
  const had = counted(before.warnings);
  const added = [...counted(after.warnings)].filter(([code, n]) => n > (had.get(code) ?? 0));
  for (const [code, n] of added) console.log(`${files[2]}: ${code}: ${n}, the input had ${had.get(code) ?? 0}`);
  process.exitCode = after.errors.length || added.length ? 1 : 0;
} else if (files.length && files[0] !== "--compare") {
  for (const file of files) {
    const found = await issues(file);
    print(file, found);
    if (found.errors.length) process.exitCode = 1;
  }
} else {
  console.error("usage: node tools/validator.mjs FILE... | --compare IN OUT");
  process.exitCode = 2;
}
