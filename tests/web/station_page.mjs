// The ground station's page in a real browser, served by perch-live:
//   node station_page.mjs PERCH_LIVE SOURCE_DIR [SCREENSHOT_DIR]
// Exit code 77, said loudly, where there is no Chromium.
import assert from 'node:assert/strict';
import {spawn} from 'node:child_process';
import {existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import {join, resolve} from 'node:path';

const [perchLive, source, screenshots] = process.argv.slice(2).map((path) => resolve(path));
const CHROMIUM = process.env.PERCH_CHROMIUM ?? '/usr/bin/chromium';
if (!existsSync(CHROMIUM)) {
  console.log(`SKIPPED: THE GROUND STATION'S PAGE WAS NOT TESTED: ${CHROMIUM} is missing (scripts/setup --tests installs it)`);
  process.exit(77);
}
const {chromium} = createRequire(join(source, 'web/package.json'))('playwright-core');

const folder = mkdtempSync(join(tmpdir(), 'perch-page-'));
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
const running = [];
let port = 0;

// Small pictures from near, so that a busy machine keeps up with them. It ends by itself long after the test.
writeFileSync(join(folder, 'sim.yaml'), `target: ${source}/configs/targets/sharp.yaml
camera: {width: 320, height: 240, lens: LENSMODEL_PINHOLE, intrinsics: [226, 226, 159.5, 119.5], rate_hz: 15}
flight: {start_height: 4, start_aside: 0.5, touchdown_height: 1.5, duration: 120, hover: 100}
`);
writeFileSync(join(folder, 'run.yaml'), `target: ${source}/configs/targets/sharp.yaml
camera: {source: 'sim:sim.yaml'}
outputs: {station: {control: true, bandwidth: 400}, record: flights}
`);

async function until(what, test, seconds = 20) {
  for (const end = Date.now() + 1000 * seconds; Date.now() < end; await sleep(50)) if (await test()) return;
  assert.fail(`${what}: not within ${seconds} s`);
}

// Resolves once it listens.
async function start(output) {
  const live = spawn(perchLive, ['--config', 'run.yaml', '--set', `outputs.station.listen=127.0.0.1:${port}`, '--output', output], {cwd: folder});
  running.push(live);
  let log = '';
  live.stderr.on('data', (text) => { log += text; });
  await until('perch-live listens', () => /station: port \d+/.test(log) || assert.equal(live.exitCode, null, log));
  port = Number(/station: port (\d+)/.exec(log)[1]);
  return live;
}
async function stop(live) {
  const ended = new Promise((done) => live.on('exit', done));
  live.kill('SIGTERM');
  assert.equal(await ended, 0);
}

const number = async (page, id) => Number((await page.textContent('#' + id)).replace('−', '-'));
const badge = (page) => page.textContent('#badge');
async function csv(page) {
  const [download] = await Promise.all([page.waitForEvent('download'), page.click('#csv')]);
  const [head, ...rows] = readFileSync(await download.path(), 'utf8').trim().split('\n');
  return {head: head.split(','), rows: rows.map((row) => row.split(','))};
}
const table = (file) => new Map(readFileSync(file, 'utf8').trim().split('\n').slice(1).map((line) => [line.split(',')[0], line.split(',')]));
const close = (a, b, what) => assert.ok(Math.abs(Number(a) - Number(b)) <= 2e-6 * Math.max(1, Math.abs(Number(b))), `${what}: ${a} on the page, ${b} in the file`);

async function equalsTheFiles({head, rows}, output) {
  const estimates = table(join(folder, output, 'estimates.csv')), states = table(join(folder, output, 'states.csv'));
  const at = (name) => head.indexOf(name);
  let compared = 0;
  for (const row of rows) {
    const estimate = estimates.get(row[0]), state = states.get(row[0]);
    assert.ok(estimate, `${row[0]} is no frame of estimates.csv`);
    assert.equal(row[1], estimate[1]);
    if (row[1] !== 'ok') continue;
    for (const [k, name] of ['cam_x', 'cam_y', 'cam_z', 'cam_q_w', 'cam_q_x', 'cam_q_y', 'cam_q_z'].entries()) close(row[at(name)], estimate[2 + k], name);
    close(row[at('reprojection')], estimate[30], 'reprojection');
    for (const [k, name] of ['x', 'y', 'z'].entries()) close(row[at(name)], state[1 + k], name);
    for (const [k, name] of ['v_x', 'v_y', 'v_z'].entries()) close(row[at(name)], state[8 + k], name);
    ++compared;
  }
  assert.ok(compared > 15, `only ${compared} rows`);
  return compared;
}

async function shoot(page, name) {
  if (!screenshots) return;
  mkdirSync(screenshots, {recursive: true});
  await page.screenshot({path: join(screenshots, name + '.png')});
}

async function watch(browser, size, more = {}) {
  const context = await browser.newContext({viewport: size, acceptDownloads: true, ...more});
  const page = await context.newPage();
  page.on('pageerror', (error) => assert.fail(`the page: ${error}`));
  page.on('console', (message) => { if (message.type() === 'error' && /Content Security/.test(message.text())) assert.fail(message.text()); });
  await page.goto(`http://127.0.0.1:${port}/`);
  return page;
}

async function run(browser) {
  let live = await start('first');
  const page = await watch(browser, {width: 1400, height: 1000});
  const phone = await watch(browser, {width: 390, height: 844}, {deviceScaleFactor: 2, hasTouch: true, colorScheme: 'dark'});
  await until('TRACK', async () => (await badge(page)) === 'TRACK');
  await until('a value', async () => isFinite(await number(page, 'value-z')));
  await until('a picture', () => page.evaluate(() => document.querySelector('.picture canvas').width > 300));

  // Plots move: their pixels change, and so does what the numerals say.
  const plot = () => page.evaluate(() => document.querySelector('.six canvas').toDataURL().length + document.querySelector('.six canvas').toDataURL());
  const before = await plot();
  await until('the plots move', async () => (await plot()) !== before);

  await shoot(page, 'desktop');
  await shoot(phone, 'phone');

  // A second client that stalls: the first goes on, the phone comes again by itself.
  const stall = await phone.context().newCDPSession(phone);
  await until('TRACK on the phone', async () => (await badge(phone)) === 'TRACK');
  await stall.send('Network.enable');
  await stall.send('Emulation.setScriptExecutionDisabled', {value: false});
  await stall.send('Debugger.enable');
  await stall.send('Debugger.pause');
  await sleep(1500);
  const lastRow = async () => BigInt((await csv(page)).rows.at(-1)[0]);
  const then = await lastRow();
  await until('rows go on beside a stalled client', async () => (await lastRow()) > then + 1_000_000_000n);
  await stall.send('Debugger.resume').catch(() => {});
  await stall.send('Debugger.disable');
  await until('the phone is back', async () => (await badge(phone)) === 'TRACK');

  // Paused, what is shown stands still and the keyboard steps.
  await page.evaluate(() => /** @type {HTMLElement} */ (document.activeElement).blur());  // a button would be pressed
  await page.keyboard.press('Space');
  await until('paused', async () => (await page.textContent('#when')) !== 'live');
  const still = await page.textContent('#value-z');
  await sleep(600);
  assert.equal(await page.textContent('#value-z'), still);
  for (let i = 0; i < 5; ++i) await page.keyboard.press('Shift+ArrowLeft');
  await until('five seconds back', async () => (await number(page, 'when').catch(() => 0)) < -0.5 || parseFloat((await page.textContent('#when')).replace('−', '-')) < -2);
  await page.keyboard.press('End');
  await until('live', async () => (await page.textContent('#when')) === 'live');

  // Control, as the configuration allows it.
  await until('recording', async () => (await page.textContent('#record')) === 'Stop');
  await page.keyboard.press('r');
  await until('recorded', async () => /recorded .* pictures/.test(await page.textContent('#events')));
  await sleep(3000);
  await page.keyboard.press('t');
  await page.keyboard.press('z');
  await sleep(1500);
  await shoot(page, 'desktop_dark');

  const exported = await csv(page);
  await stop(live);
  console.log(`${await equalsTheFiles(exported, 'first')} rows on the page equal the files`);

  // The server is gone, and another comes.
  await until('NO LINK', async () => (await badge(page)) === 'NO LINK');
  live = await start('second');
  await until('TRACK again', async () => (await badge(page)) === 'TRACK');
  await until('rows of the new run', async () => (await csv(page)).rows.length > 30);
  const again = await csv(page);
  await stop(live);
  await equalsTheFiles(again, 'second');
}

const browser = await chromium.launch({
  executablePath: CHROMIUM, headless: true,
  args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync'],
});
try {
  await run(browser);
} finally {
  await browser.close();
  for (const live of running) live.kill('SIGKILL');
  rmSync(folder, {recursive: true, force: true});
}
