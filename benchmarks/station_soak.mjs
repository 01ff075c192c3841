// Whether the ground station or its page grows: a simulated flight at 30 Hz with a page that watches, for half an hour. Once
// a minute the page is used (colours, close-up, stretch, pause), rubbish is collected, and the memory of all is printed.
//   node benchmarks/station_soak.mjs build/release/bin/perch-live [MINUTES]
// Exit code 1 when a row of the last third is more than a tenth, and 4 MB, above those of the second.
import {spawn} from 'node:child_process';
import {mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {setPriority, tmpdir} from 'node:os';
import {join, resolve} from 'node:path';

const [program, minutes = '30'] = process.argv.slice(2);
const source = resolve(new URL('.', import.meta.url).pathname, '..');
const {chromium} = createRequire(join(source, 'web/package.json'))('playwright-core');
const folder = mkdtempSync(join(tmpdir(), 'perch-soak-'));
const sleep = (ms) => new Promise((done) => setTimeout(done, ms));
setPriority(10);  // it is there for half an hour: others first
writeFileSync(join(folder, 'sim.yaml'), `target: ${source}/configs/targets/sharp.yaml
camera: {width: 320, height: 240, lens: LENSMODEL_PINHOLE, intrinsics: [226, 226, 159.5, 119.5], rate_hz: 30}
flight: {start_height: 4, start_aside: 0.5, touchdown_height: 1.5, duration: 30, hover: ${60 * Number(minutes) + 100}}
`);
writeFileSync(join(folder, 'run.yaml'), `target: ${source}/configs/targets/sharp.yaml
camera: {source: 'sim:sim.yaml'}
outputs: {station: {listen: '127.0.0.1:0', control: true}}
`);

const megabytes = (pid) => Number(/VmRSS:\s+(\d+)/.exec(readFileSync(`/proc/${pid}/status`, 'utf8'))?.[1]) / 1000;
const mean = (numbers) => numbers.reduce((a, b) => a + b, 0) / numbers.length;

async function soak(live, browser) {
  let log = '';
  live.stderr.on('data', (text) => { log = (log + text).slice(-4000); });
  while (!/station: port \d+/.test(log)) await sleep(20);
  const url = `http://127.0.0.1:${/station: port (\d+)/.exec(log)?.[1]}/`;
  const page = await (await browser.newContext({viewport: {width: 390, height: 844}})).newPage();
  await page.goto(url);
  const session = await page.context().newCDPSession(page);
  await session.send('Performance.enable');
  const whole = await browser.newBrowserCDPSession();
  const rows = [];
  console.log('minute   perch-live   page: JS heap   renderer   GPU   browser process, MB   nodes   listeners');
  for (let minute = 1; minute <= Number(minutes); ++minute) {
    const end = Date.now() + 60000;
    await page.evaluate(() => /** @type {HTMLElement} */ (document.activeElement).blur());
    for (const key of ['t', 't', 'z', 'z', 'w', 'w', 'w', 'w', 'Space', 'ArrowLeft', 'End']) {
      await page.keyboard.press(key);
      await sleep(300);
    }
    await sleep(end - Date.now());
    await session.send('HeapProfiler.collectGarbage');
    const metrics = Object.fromEntries((await session.send('Performance.getMetrics')).metrics.map(({name, value}) => [name, value]));
    const {processInfo} = await whole.send('SystemInfo.getProcessInfo');
    const rss = (type) => processInfo.filter((one) => one.type === type).reduce((sum, {id}) => sum + megabytes(id), 0);
    const row = [megabytes(live.pid), metrics.JSHeapUsedSize / 1e6, rss('renderer'), rss('GPU'), rss('browser')];
    rows.push(row);
    console.log(`${String(minute).padStart(6)} ${row.map((mb) => mb.toFixed(1).padStart(12)).join('')} ${String(metrics.Nodes).padStart(10)} ${String(metrics.JSEventListeners).padStart(8)}`);
  }
  let grew = false;
  const third = Math.floor(rows.length / 3);
  ['perch-live', 'JS heap', 'renderer', 'GPU process', 'browser'].forEach((name, i) => {
    const middle = mean(rows.slice(third, 2 * third).map((row) => row[i])), last = mean(rows.slice(2 * third).map((row) => row[i]));
    const more = last - middle > Math.max(4, 0.1 * middle);
    grew ||= more;
    console.log(`${name}: ${middle.toFixed(1)} MB in the second third, ${last.toFixed(1)} MB in the last${more ? ': IT GROWS' : ''}`);
  });
  return grew ? 1 : 0;
}

const live = spawn(program, ['--config', 'run.yaml'], {cwd: folder});
const browser = await chromium.launch({
  executablePath: process.env.PERCH_CHROMIUM ?? '/usr/bin/chromium', headless: true,
  args: ['--no-sandbox', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-gpu-rasterization', '--disable-gpu-compositing', '--disable-accelerated-2d-canvas', '--enable-precise-memory-info', '--disable-background-networking', '--disable-component-update', '--disable-sync', '--no-first-run'],
});
try {
  process.exitCode = await soak(live, browser);
} finally {
  await browser.close();
  live.kill('SIGKILL');
  rmSync(folder, {recursive: true, force: true});
}
