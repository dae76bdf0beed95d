// Makes the pages: node build.mjs OUT_DIR writes
//   OUT_DIR/pages/   index.html, and scripts and styles whose names hold a hash of their content
//   OUT_DIR/pages.c  the same, gzipped, as the table of server/web/pages.h
//   OUT_DIR/sizes.json  bytes of each, as they are and gzipped
// node build.mjs --tests OUT_DIR checks the types of all, and bundles test/*.test.ts for node --test.
import { execFileSync } from "node:child_process";
import { createHash } from "node:crypto";
import { existsSync, mkdirSync, readdirSync, readFileSync, rmSync, symlinkSync, writeFileSync } from "node:fs";
import { basename, dirname, extname, join, relative, resolve } from "node:path";
import { fileURLToPath } from "node:url";
import { gzipSync } from "node:zlib";
import { build } from "esbuild";

const web = dirname(fileURLToPath(import.meta.url));
const bin = join(web, "node_modules", ".bin");

function run(program, ...args) {
  try {
    execFileSync(program, args, { cwd: web, stdio: ["ignore", "inherit", "inherit"] });
  } catch (error) {
    console.error(`build.mjs: ${basename(program)} failed${error.status == null ? `: ${error.message}` : ""}`);
    process.exit(1);
  }
}

// The readers of messages, from the one schema.
function generate(folder) {
  rmSync(folder, { recursive: true, force: true });
  mkdirSync(folder, { recursive: true });
  const wire = resolve(web, "../shared/wire");
  run("protoc", `--plugin=protoc-gen-es=${join(bin, "protoc-gen-es")}`, "--es_opt=target=ts",
    `--es_out=${folder}`, "-I", wire, "arthron.proto");
}

// So that sources can say `from "wire"` wherever the build folder is. Pages know nothing of node.
function check(out, folder, types) {
  const config = {
    extends: join(web, "tsconfig.json"),
    compilerOptions: {
      baseUrl: web,
      typeRoots: [join(web, "node_modules/@types")],
      types,
      paths: { wire: [join(out, "wire/arthron_pb.ts")] },
    },
    include: [join(web, folder, "**/*.ts"), join(web, folder, "**/*.tsx")],
  };
  writeFileSync(join(out, "tsconfig.json"), JSON.stringify(config));
  run(join(bin, "tsc"), "--project", join(out, "tsconfig.json"));
}

// Text of three's shaders that no view compiles: of other materials than Phong's, of environments, skins, morphs and bumps,
// and of shadows, which the scope has its own for.
const UNUSED_SHADERS = ["alphahash_pars_fragment", "batching_pars_vertex", "bumpmap_pars_fragment",
  "clearcoat_normal_fragment_begin", "clearcoat_normal_fragment_maps", "clearcoat_pars_fragment",
  "cube_uv_reflection_fragment", "envmap_common_pars_fragment", "envmap_fragment", "envmap_pars_fragment",
  "envmap_pars_vertex", "envmap_physical_pars_fragment", "envmap_vertex", "gradientmap_pars_fragment",
  "iridescence_fragment", "iridescence_pars_fragment", "lights_lambert_fragment", "lights_lambert_pars_fragment",
  "lights_physical_fragment", "lights_physical_pars_fragment", "lights_toon_fragment", "lights_toon_pars_fragment",
  "map_particle_fragment", "map_particle_pars_fragment", "morphtarget_pars_vertex", "morphtarget_vertex",
  "normalmap_pars_fragment", "shadowmap_pars_fragment", "shadowmask_pars_fragment", "skinbase_vertex",
  "skinning_pars_vertex", "skinning_vertex", "skinnormal_vertex", "transmission_fragment",
  "transmission_pars_fragment"];

// No page is seen through a headset.
const NO_HEADSET = `class WebXRManager extends EventDispatcher {
  enabled = false; isPresenting = false;
  getEnvironmentBlendMode() {} setAnimationLoop() {} dispose() {}
}
`;

function withoutUnused(three) {
  for (const name of UNUSED_SHADERS) {
    const shorter = three.replace(new RegExp(`^var ${name} = ".*";$`, "m"), `var ${name} = "";`);
    if (shorter === three) throw new Error(`three has no shader text ${name}`);
    three = shorter;
  }
  const shorter = three.replace(/^class WebXRManager [^]*?^}$/m, NO_HEADSET);
  if (shorter === three) throw new Error("three has no WebXRManager");
  return shorter;
}

const smallThree = {
  name: "small-three",
  setup: ({ onLoad }) => onLoad({ filter: /three\.module\.js$/ }, ({ path }) => ({ contents: withoutUnused(readFileSync(path, "utf8")) })),
};

const common = (out) => ({
  absWorkingDir: web,
  bundle: true,
  metafile: true,
  target: "es2022",
  charset: "utf8",
  legalComments: "none",
  logLevel: "warning",
  jsx: "automatic",
  jsxImportSource: "preact",
  alias: { wire: join(out, "wire/arthron_pb.ts") },
});

async function bundleTests(out) {
  const tests = readdirSync(join(web, "test")).filter((name) => /\.test\.tsx?$/.test(name));
  await build({
    ...common(out),
    entryPoints: tests.map((name) => join(web, "test", name)),
    outdir: out,
    platform: "node",
    format: "esm",
    outExtension: { ".js": ".mjs" },
  });
}

// Where each entry went: its name here, its name there.
function entries(result, pages) {
  const found = {};
  for (const [file, output] of Object.entries(result.metafile.outputs))
    if (output.entryPoint) found[output.entryPoint] = relative(pages, resolve(web, file));
  return found;
}

async function bundlePages(out) {
  const pages = join(out, "pages");
  rmSync(pages, { recursive: true, force: true });
  const options = { ...common(out), outdir: pages, minify: true, plugins: [smallThree], entryNames: "[name]-[hash]", chunkNames: "[name]-[hash]",
    assetNames: "[name]-[hash]", loader: { ".svg": "file" } };
  const names = {
    ...entries(await build({ ...options, entryPoints: ["src/main.tsx"], format: "esm", splitting: true }), pages),
    ...entries(await build({ ...options, entryPoints: ["src/theme.ts"], format: "iife" }), pages),
    ...entries(await build({ ...options, entryPoints: ["src/style/main.css"] }), pages),
    ...entries(await build({ ...options, entryPoints: ["src/icon.svg"], loader: { ".svg": "copy" } }), pages),
  };
  const html = readFileSync(join(web, "src/index.html"), "utf8").replace(/\{\{(.+?)\}\}/g, (_, entry) => {
    if (!names[entry]) throw new Error(`index.html: no ${entry}`);
    return `/${names[entry]}`;
  });
  writeFileSync(join(pages, "index.html"), html);
  return pages;
}

const TYPES = {
  ".html": "text/html; charset=utf-8",
  ".js": "text/javascript; charset=utf-8",
  ".css": "text/css; charset=utf-8",
  ".svg": "image/svg+xml",
};

// As zlib packs it everywhere: no time, no system in the header.
function pack(bytes) {
  const gzip = gzipSync(bytes, { level: 9 });
  gzip[9] = 255;
  return gzip;
}

function table(out, pages) {
  const rows = [];
  const arrays = [];
  const sizes = {};
  for (const name of readdirSync(pages).sort()) {
    const bytes = readFileSync(join(pages, name));
    const gzip = pack(bytes);
    const type = TYPES[extname(name)];
    if (!type) throw new Error(`${name}: no media type`);
    const etag = createHash("sha256").update(bytes).digest("hex").slice(0, 16);
    arrays.push(`static const uint8_t page_${rows.length}[] = {${[...gzip].join(",").replace(/(.{1,110}),/g, "$1,\n")}};\n`);
    rows.push(`    {"/${name}", "${type}", "${etag}", ${name !== "index.html"}, page_${rows.length}, ${gzip.length}, ${bytes.length}},\n`);
    sizes[name] = { bytes: bytes.length, gzip: gzip.length };
  }
  writeFileSync(join(out, "pages.c"), `// Made by web/build.mjs.
#include "web/pages.h"

${arrays.join("")}
static const struct web_page pages[] = {
${rows.join("")}};

const struct web_pages web_pages_built_in = {pages, ${rows.length}};
`);
  writeFileSync(join(out, "sizes.json"), `${JSON.stringify(sizes, null, 1)}\n`);
  const total = Object.values(sizes).reduce((sum, size) => sum + size.gzip, 0);
  console.log(`${rows.length} pages, ${(total / 1000).toFixed(1)} kB gzipped`);
}

const args = process.argv.slice(2);
const tests = args[0] === "--tests" && args.shift() !== undefined;
if (args.length !== 1) {
  console.error("Usage: node build.mjs [--tests] OUT_DIR");
  process.exit(2);
}
if (!existsSync(bin)) {
  console.error("build.mjs: run `npm ci` in web/ first");
  process.exit(1);
}
const out = resolve(args[0]);
mkdirSync(out, { recursive: true });
rmSync(join(out, "node_modules"), { force: true });
symlinkSync(join(web, "node_modules"), join(out, "node_modules")); // for what is generated there
generate(join(out, "wire"));
if (tests) {
  check(out, "src", []);
  check(out, "test", ["node"]);
  await bundleTests(out);
} else {
  table(out, await bundlePages(out));
}
