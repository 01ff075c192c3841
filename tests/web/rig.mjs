// What the tests of the ground station's page share: Chromium, perch-live in a folder of its own, and the files it writes.
import assert from 'node:assert/strict';
import {spawn, spawnSync} from 'node:child_process';
import {existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import {dirname, join, resolve} from 'node:path';

// Each test:   node TEST.mjs PERCH_LIVE SOURCE_DIR [SCREENSHOT_DIR]
// Exit code 77, said loudly, where there is no Chromium.
const [perchLive, source, screenshots] = process.argv.slice(2).map((path) => resolve(path));
export {source};
const CHROMIUM = process.env.PERCH_CHROMIUM ?? '/usr/bin/chromium';
if (!existsSync(CHROMIUM)) {
  console.log(`SKIPPED: THE GROUND STATION'S PAGE WAS NOT TESTED: ${CHROMIUM} is missing (scripts/setup --tests installs it)`);
  process.exit(77);
}
const {chromium} = createRequire(join(source, 'web/package.json'))('playwright-core');

export const folder = mkdtempSync(join(tmpdir(), 'perch-page-'));
export const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
export const write = (name, text) => writeFileSync(join(folder, name), text);
export const program = (name) => join(dirname(perchLive), name);
const running = [];

// Small pictures from near, so that a busy machine keeps up with them. It ends by itself long after the test.
export const target = `target: ${source}/configs/targets/sharp.yaml\n`;
write('sim.yaml', `${target}camera: {width: 320, height: 240, lens: LENSMODEL_PINHOLE, intrinsics: [226, 226, 159.5, 119.5], rate_hz: 15}
flight: {start_height: 4, start_aside: 0.5, touchdown_height: 1.5, duration: 120, hover: 100}
`);

// How long what comes within seconds is waited for: a machine that others load may take many times that.
export async function until(what, test, seconds = 40) {
  for (const end = Date.now() + 1000 * seconds; Date.now() < end; await sleep(50)) if (await test()) return;
  assert.fail(`${what}: not within ${seconds} s`);
}

export function begin(file, args) {
  const child = spawn(file, args, {cwd: folder});
  running.push(child);
  const process = Object.assign(child, {log: ''});
  child.stderr.on('data', (text) => { process.log += text; });
  child.stdout.on('data', (text) => { process.log += text; });
  return process;
}
export function run(file, args) {
  const {status, stderr} = spawnSync(file, args, {cwd: folder, encoding: 'utf8'});
  assert.equal(status, 0, stderr);
}

// perch-live, once it listens; `port` is where.
export async function start(config, listen, ...more) {
  const live = begin(perchLive, ['--config', config, '--set', `outputs.station.listen=${listen}`, ...more]);
  await until('perch-live listens', () => /station: port \d+/.test(live.log) || assert.equal(live.exitCode, null, live.log));
  return Object.assign(live, {port: Number(/station: port (\d+)/.exec(live.log)[1])});
}
export async function stop(live) {
  const ended = new Promise((done) => live.on('exit', done));
  live.kill('SIGTERM');
  assert.equal(await ended, 0, live.log);
}

export const DESK = {width: 1400, height: 1000}, PHONE = {width: 390, height: 844};

export async function watch(browser, url, size, more = {}) {
  const context = await browser.newContext({viewport: size, acceptDownloads: true, ...more});
  const page = await context.newPage();
  page.on('pageerror', (error) => assert.fail(`the page: ${error}`));
  page.on('console', (message) => { if (message.type() === 'error' && /Content Security/.test(message.text())) assert.fail(message.text()); });
  await page.goto(url);
  return page;
}

const plain = (text) => text.replace('−', '-');
export const number = async (page, id) => Number(plain(await page.textContent('#' + id)));
export const seconds = async (page) => parseFloat(plain(await page.textContent('#when')));
export const badge = (page) => page.textContent('#badge');
export const fact = (page, name) => page.textContent(`#fact-${name}`);
// Keys are the page's while no button has the focus.
export async function press(page, ...keys) {
  await page.evaluate(() => document.activeElement.blur());
  for (const key of keys) await page.keyboard.press(key);
}

export async function download(page, id) {
  const [file] = await Promise.all([page.waitForEvent('download'), page.click('#' + id)]);
  return readFileSync(await file.path());
}
// The rows that are seen, as the page exports them. Not at once after the last: Chromium then takes it for a nuisance.
export async function csv(page) {
  await sleep(400);
  const [head, ...rows] = (await download(page, 'csv')).toString().trim().split('\n');
  const names = head.split(',');
  return {names, rows: rows.map((row) => row.split(',')), at: (row, name) => row[names.indexOf(name)]};
}

// A table by its first column.
const table = (file) => new Map(readFileSync(file, 'utf8').trim().split('\n').slice(1).map((line) => [line.split(',')[0], line.split(',')]));
// The times of all frames of a run, as they are in its files.
export const frames = (output) => [...table(join(folder, output, 'estimates.csv')).keys()];
// What the page has are floats: 24 binary digits.
export const close = (a, b, what) => assert.ok(Math.abs(Number(a) - Number(b)) <= 2e-6 * Math.max(1, Math.abs(Number(b))), `${what}: ${a} on the page, ${b} in the file`);

// Every exported row is what estimates.csv and states.csv of the same run say of that frame.
export function equalsTheFiles({rows, at}, output, least = 15) {
  const estimates = table(join(folder, output, 'estimates.csv')), states = table(join(folder, output, 'states.csv'));
  let compared = 0;
  for (const row of rows) {
    const estimate = estimates.get(row[0]), state = states.get(row[0]);
    assert.ok(estimate, `${row[0]} is no frame of estimates.csv`);
    assert.equal(row[1], estimate[1]);
    if (row[1] !== 'ok') continue;
    for (const [k, name] of ['cam_x', 'cam_y', 'cam_z', 'cam_q_w', 'cam_q_x', 'cam_q_y', 'cam_q_z'].entries()) close(at(row, name), estimate[2 + k], name);
    close(at(row, 'reprojection'), estimate[30], 'reprojection');
    for (const [k, name] of ['x', 'y', 'z'].entries()) close(at(row, name), state[1 + k], name);
    for (const [k, name] of ['v_x', 'v_y', 'v_z'].entries()) close(at(row, name), state[8 + k], name);
    ++compared;
  }
  assert.ok(compared >= least, `only ${compared} rows`);
  return compared;
}

export async function shoot(page, name) {
  if (!screenshots) return;
  mkdirSync(screenshots, {recursive: true});
  await page.screenshot({path: join(screenshots, name + '.png')});
}

// Runs a test with a browser, and leaves nothing behind. Canvases are drawn by the processor without the detour over an
// imitated graphics card, which alone would keep a core busy; WebGL needs it.
export async function inChromium(test) {
  const browser = await chromium.launch({
    executablePath: CHROMIUM, headless: true,
    args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-gpu-rasterization', '--disable-gpu-compositing',
           '--disable-accelerated-2d-canvas', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync'],
  });
  try {
    await test(browser);
  } finally {
    await browser.close();
    for (const child of running) child.kill('SIGKILL');
    rmSync(folder, {recursive: true, force: true});
  }
}
