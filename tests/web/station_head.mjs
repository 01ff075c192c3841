// A camera that a head turns, on the ground station's page: where it looks, its zoom, and the command to centre it.
import assert from 'node:assert/strict';
import {createSocket} from 'node:dgram';
import {readFileSync, readdirSync} from 'node:fs';
import {join} from 'node:path';
import {DESK, badge, begin, close, csv, fact, folder, inChromium, press, program, shoot, start, stop, target, until, watch, write} from './rig.mjs';

async function freePort() {
  const socket = createSocket('udp4');
  await new Promise((done) => socket.bind(0, '127.0.0.1', () => done(null)));
  const {port} = socket.address();
  await new Promise((done) => socket.close(() => done(null)));
  return port;
}

await inChromium(async (browser) => {
  const port = await freePort(), terminal = join(folder, 'evi');
  const device = begin(program('perch-visca-sim'), ['--pty', terminal, '--truth', `udp://127.0.0.1:${port}`]);
  await until('the device', () => /an EVI-D30 at/.test(device.log));
  write('head.yaml', `${target}camera:
  {width: 320, height: 240, rate_hz: 15, lens: LENSMODEL_PINHOLE, intrinsics: [352.7, 352.7, 159.5, 119.5], head: 'udp:127.0.0.1:${port}',
   body_from_camera: {position: [0.1, 0, 0.05], rotation: {ypr_deg: [90, 0, 0]}}}
flight: {start_height: 5, start_aside: 1, touchdown_height: 2.5, duration: 60, hover: 60, gust_attitude_deg: 2}
`);
  write('run.yaml', `${target}camera: {source: 'sim:head.yaml'}
frames: {base_from_camera: {pan_tilt: {}}}
ptz: {device: 'visca+serial:${terminal}:9600'}
outputs: {station: {control: true}, record: flights}
`);
  const live = await start('run.yaml', '127.0.0.1:0');
  const page = await watch(browser, `http://127.0.0.1:${live.port}/`, DESK);
  await until('TRACK', async () => (await badge(page)) === 'TRACK');
  await until('where the head looks', async () => /^pan −?\d+\.\d°, tilt −?\d+\.\d°, zoom 0\.00$/.test(await fact(page, 'head')));
  assert.equal(await page.locator('.others figure').count(), 5);  // its angles have a plot of their own
  await until('its angles in the rows', async () => {
    const {rows, at} = await csv(page);
    return rows.filter((row) => at(row, 'pan') !== '').length > 30;
  });
  await shoot(page, 'head_light');

  // The pad is 11 degrees aside; for 2 s the head looks where it looked when it was switched on.
  // No number, neither near nor far, while its angles are not known: its answers may be late on a busy machine, on which the
  // page may not say either in time that the head is in its middle; the rows have it.
  const off = async () => {
    const angles = (await fact(page, 'head')).replaceAll('−', '-').match(/-?\d+\.\d(?=°)/g);
    return angles ? Math.hypot(...angles.map(Number)) : NaN;
  };
  await until('the head looks aside', async () => (await off()) > 3);
  assert.ok(await page.isVisible('#centre'));
  const pressed = process.hrtime.bigint();
  await press(page, 'h');
  await until('the command is answered', async () => /the head goes to its middle/.test(await page.textContent('#events')));
  await until('the head in its middle', async () => {
    const {rows, at} = await csv(page);
    return rows.some((row) => BigInt(row[0]) > pressed && at(row, 'pan') !== '' && Math.hypot(at(row, 'pan'), at(row, 'tilt')) < 0.5);
  });
  await until('it follows again', async () => (await off()) > 3);

  const {rows, at} = await csv(page);
  await stop(live);
  // What the page says of each frame is what the recording says the estimator was given.
  const [flight] = readdirSync(join(folder, 'flights'));
  const recorded = new Map(readFileSync(join(folder, 'flights', flight, 'mav0/gimbal0/data.csv'), 'utf8').trim().split('\n').slice(1).map((line) => [line.split(',')[0], line.split(',').map(Number)]));
  let compared = 0;
  for (const row of rows) {
    const head = recorded.get(row[0]);
    if (!head) continue;
    close(at(row, 'pan'), head[1] * 180 / Math.PI, 'pan');
    close(at(row, 'tilt'), head[2] * 180 / Math.PI, 'tilt');
    ++compared;
  }
  assert.ok(compared > 15, `only ${compared} rows`);
  console.log(`${compared} rows have the head's angles as they were recorded`);
});
