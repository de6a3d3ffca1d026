// Looks at animated meshes as a viewer shows them: three.js with its own loaders and mixer, in
// headless Chromium, gives one contact sheet. Columns are moments, rows are views.
//
//   node tools/web/look.mjs FILE.glb [MORE.glb ...] -o SHEET.png [options]
//
// FILE: .glb, .gltf or .obj (static). Several files are stacked, each with its rows, to compare.
//
//   --frames 0,0.25,0.5,0.75   moments as shares of the animation's duration (the default)
//   --times 0,1.5,2            moments in seconds, instead
//   --views front,side         of front (camera at +Z), back, side (camera at +X), right (-X), top, iso
//   --size 480x480             of one cell, pixels
//   --animation NAME|INDEX     default: the first
//   --follow                   camera centred on the body at each moment, same scale in every cell
//   --materials                the file's own materials; default: grey clay, back faces red
//   --skeleton                 draws the bones of a skin over the body
//   --wire                     draws triangle edges
//   --zoom 1                   above 1: closer
//
// The grid lies at the lowest point of the rest mesh; its cell size is in the label. At its corner
// stand the axes: x red, y green, z blue (a figure that faces the front camera faces +z).
// CHROMIUM names the browser (default /usr/bin/chromium). Modules: npm ci in this folder, or NODE_PATH.
import { createServer } from 'node:http';
import { createReadStream, existsSync, mkdtempSync, rmSync, statSync, writeFileSync } from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { fileURLToPath } from 'node:url';
import { parseArgs } from 'node:util';
import { moduleFolder, requireModule } from './modules.mjs';

const here = path.dirname(fileURLToPath(import.meta.url));

function fail(message, status = 2) {
  console.error(`look: ${message}`);
  process.exit(status);
}

function numbers(text, flag) {
  const values = text.split(',').map(Number);
  if (values.some((value) => !Number.isFinite(value))) fail(`${flag} '${text}'; expected numbers with commas`);
  return values;
}

function readArguments() {
  let parsed;
  try {
    parsed = parseArgs({
      allowPositionals: true,
      options: {
        output: { type: 'string', short: 'o' },
        frames: { type: 'string' },
        times: { type: 'string' },
        views: { type: 'string', default: 'front,side' },
        size: { type: 'string', default: '480x480' },
        animation: { type: 'string', default: '0' },
        zoom: { type: 'string', default: '1' },
        follow: { type: 'boolean', default: false },
        materials: { type: 'boolean', default: false },
        skeleton: { type: 'boolean', default: false },
        wire: { type: 'boolean', default: false },
      },
    });
  } catch (error) {
    fail(error.message);
  }
  const { values, positionals } = parsed;
  if (positionals.length === 0 || !values.output) fail('usage: look.mjs FILE... -o SHEET.png [options]');
  for (const file of positionals) if (!existsSync(file)) fail(`${file}: no such file`, 3);
  const size = /^(\d+)x(\d+)$/.exec(values.size);
  if (!size) fail(`--size '${values.size}'; expected WIDTHxHEIGHT`);
  return {
    files: positionals.map((file) => path.resolve(file)),
    output: values.output,
    page: {
      times: values.times ? numbers(values.times, '--times') : null,
      shares: numbers(values.frames ?? '0,0.25,0.5,0.75', '--frames'),
      views: values.views.split(','),
      width: Number(size[1]),
      height: Number(size[2]),
      animation: values.animation,
      zoom: numbers(values.zoom, '--zoom')[0],
      follow: values.follow,
      materials: values.materials,
      skeleton: values.skeleton,
      wire: values.wire,
    },
  };
}

const kTypes = { '.mjs': 'text/javascript', '.js': 'text/javascript', '.html': 'text/html', '.png': 'image/png',
                 '.jpg': 'image/jpeg', '.gltf': 'application/json' };

/** Serves three.js, the page, and each input's folder, to this machine alone. */
function serve(files, three) {
  const resolve = (url) => {
    const parts = decodeURIComponent(new URL(url, 'http://localhost').pathname).split('/').slice(1);
    if (parts.includes('..')) return null;
    if (parts[0] === 'three') return path.join(three, ...parts.slice(1));
    if (parts[0] === 'input' && files[parts[1]]) return path.join(path.dirname(files[parts[1]]), ...parts.slice(2));
    return path.join(here, parts[0] === '' ? 'look_page.html' : parts[0]);
  };
  const server = createServer((request, response) => {
    const file = resolve(request.url);
    if (file === null || !existsSync(file) || !statSync(file).isFile()) {
      response.writeHead(404).end();
      return;
    }
    response.writeHead(200, { 'content-type': kTypes[path.extname(file)] ?? 'application/octet-stream',
                              'content-length': statSync(file).size });
    createReadStream(file).pipe(response);
  });
  return new Promise((done) => server.listen(0, '127.0.0.1', () => done(server)));
}

async function main() {
  const { files, output, page: settings } = readArguments();
  const { chromium } = requireModule('playwright-core');
  const three = moduleFolder('three');
  if (three === null) fail('three is not installed: run npm ci in this folder, or set NODE_PATH', 77);
  const browser_path = process.env.CHROMIUM ?? '/usr/bin/chromium';
  if (!existsSync(browser_path)) fail(`no browser at ${browser_path}: set CHROMIUM`, 77);

  const server = await serve(files, three);
  const origin = `http://127.0.0.1:${server.address().port}`;
  const profile = mkdtempSync(path.join(os.tmpdir(), 'look-'));
  const context = await chromium.launchPersistentContext(profile, {
    executablePath: browser_path,
    headless: true,
    args: ['--no-sandbox', '--disable-gpu', '--use-gl=angle', '--use-angle=swiftshader',
           '--enable-unsafe-swiftshader', '--disable-dev-shm-usage'],
  });
  let status = 0;
  try {
    const page = context.pages()[0] ?? (await context.newPage());
    page.on('console', (message) => {
      const text = message.text();
      // A software renderer reads pixels back slowly and says so; nothing else is expected.
      if (['error', 'warning'].includes(message.type()) && !/GPU stall|GL Driver|software/i.test(text)) {
        if (message.type() === 'error') status = 1;
        console.error(`look: ${text}`);
      }
    });
    page.on('pageerror', (error) => console.error(`look: ${error.message}`));
    await page.goto(origin);
    await page.waitForFunction(() => window.look !== undefined, null, { timeout: 30000 });
    const inputs = files.map((file, index) => ({
      name: path.basename(file),
      url: `/input/${index}/${encodeURIComponent(path.basename(file))}`,
    }));
    const sheet = await page.evaluate(([list, how]) => window.look(list, how), [inputs, settings]);
    for (const line of sheet.lines) console.log(line);
    writeFileSync(output, Buffer.from(sheet.png.split(',')[1], 'base64'));
    console.log(`${output}: ${sheet.width} x ${sheet.height}`);
  } catch (error) {
    console.error(`look: ${error.message.split('\n')[0]}`);
    status = 1;
  } finally {
    await context.close();
    server.close();
    rmSync(profile, { recursive: true, force: true });
  }
  process.exit(status);
}

await main();
