// Bundles the pages with esbuild:
//   node build.js station assets.cc   the ground station's files, compressed, as a C++ table (perch/station/assets.h)
//   node build.js report FOLDER       report.js and mount.js, which the reports carry in them, and report.css
import {createHash} from 'node:crypto';
import {mkdirSync, readFileSync, writeFileSync} from 'node:fs';
import {dirname, join} from 'node:path';
import {fileURLToPath} from 'node:url';
import {gzipSync} from 'node:zlib';
import {build} from 'esbuild';

const source = join(dirname(fileURLToPath(import.meta.url)), 'src');
const common = {bundle: true, minify: true, write: false, legalComments: 'inline', target: 'es2022', charset: 'utf8', logLevel: 'warning'};

const TYPES = {html: 'text/html; charset=utf-8', js: 'text/javascript; charset=utf-8', css: 'text/css; charset=utf-8', svg: 'image/svg+xml'};

// The 3-D view is a file of its own, fetched after the numbers are there: it is the largest.
async function stationFiles() {
  const {outputFiles} = await build({...common, entryPoints: [join(source, 'station/station.js'), join(source, 'station/station.css'), join(source, 'station/login.css')],
                                     outdir: '/', outbase: join(source, 'station'), format: 'esm', splitting: true, chunkNames: 'part-[hash]'});
  const files = new Map(outputFiles.map((file) => [file.path, Buffer.from(file.contents)]));
  for (const name of ['index.html', 'login.html', 'icon.svg']) files.set('/' + name, readFileSync(join(source, 'station', name)));
  return files;
}

// A string literal of bytes; octal, as a hexadecimal escape would take in the digit after it.
function literal(bytes) {
  const lines = [];
  for (let i = 0; i < bytes.length; i += 40) {
    lines.push('    "' + [...bytes.subarray(i, i + 40)].map((byte) => '\\' + byte.toString(8).padStart(3, '0')).join('') + '"');
  }
  return lines.join('\n');
}

function table(files) {
  const open = new Set(['/login.html', '/login.css', '/icon.svg']);
  let text = '// Made by web/build.js.\n#include "perch/station/assets.h"\n\nnamespace perch {\nnamespace {\n\n';
  const rows = [];
  for (const [path, content] of [...files].sort(([a], [b]) => (a < b ? -1 : 1))) {
    const bytes = gzipSync(content, {level: 9});
    const etag = createHash('sha256').update(content).digest('hex').slice(0, 16);
    const name = 'kFile' + rows.length;
    text += `constexpr char ${name}[] =\n${literal(bytes)};\n\n`;
    rows.push(`    {"${path}", "${TYPES[path.split('.').pop()]}", {${name}, ${bytes.length}}, "\\"${etag}\\"", ${open.has(path)}},`);
  }
  return text + `constexpr Asset kAssets[] = {\n${rows.join('\n')}\n};\n\n}  // namespace\n\nstd::span<const Asset> station_assets() { return kAssets; }\n\n}  // namespace perch\n`;
}

const [page, output] = process.argv.slice(2);
if (page === 'station') {
  writeFileSync(output, table(await stationFiles()));
} else if (page === 'report') {
  const {outputFiles} = await build({...common, entryPoints: ['report.js', 'mount.js', 'report.css'].map((name) => join(source, 'report', name)), outdir: output, format: 'iife'});
  mkdirSync(output, {recursive: true});
  for (const file of outputFiles) writeFileSync(file.path, file.contents);
} else {
  console.error('build.js: expected station or report, and where to write');
  process.exit(2);
}
