// A recorded flight in the ground station's page: its values are the files', navigation's are over them, and they stay when
// the recording is at its end.
import assert from 'node:assert/strict';
import {readFileSync} from 'node:fs';
import {join} from 'node:path';
import {DESK, badge, csv, equalsTheFiles, fact, folder, inChromium, press, program, run, seconds, shoot, start, target, until, watch, write} from './rig.mjs';

// Beside the flight perch-simulate writes perch.yaml, which says where the pad is in the world: navigation can be compared.
write('flight.yaml', `${target}camera: {width: 320, height: 240, lens: LENSMODEL_PINHOLE, intrinsics: [226, 226, 159.5, 119.5], rate_hz: 15}
flight: {start_height: 4, start_aside: 0.5, touchdown_height: 1.5, duration: 20}
`);

const numbers = (file) => readFileSync(join(folder, file), 'utf8').trim().split('\n').slice(1).map((line) => line.split(','));

// The body's place in the pad's frame by navigation: between two rows of nav0 on a straight line, less where the pad is,
// turned by the transpose of world_from_pad's rotation.
function navigationIn(perchYaml) {
  const [, position, rotation] = /world_from_pad: \{position: \[([^\]]+)\], rotation: \{quaternion_wxyz: \[([^\]]+)\]/.exec(perchYaml);
  const t = position.split(',').map(Number), [w, x, y, z] = rotation.split(',').map(Number);
  const R = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
             [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
             [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]];
  const rows = numbers('landing/mav0/nav0/data.csv').map(([ns, ...p]) => ({ns: BigInt(ns), p: p.slice(0, 3).map(Number)}));
  return (ns) => {
    const after = rows.findIndex((row) => row.ns >= ns);
    if (after < 1) return null;
    const [a, b] = [rows[after - 1], rows[after]];
    const share = Number(ns - a.ns) / Number(b.ns - a.ns);
    const d = a.p.map((one, i) => one + share * (b.p[i] - one) - t[i]);
    return [0, 1, 2].map((k) => R[0][k] * d[0] + R[1][k] * d[1] + R[2][k] * d[2]);
  };
}

// How many pixels of one of the six plots are orange, vision's, and blue, navigation's.
const coloured = (page, plot) => page.evaluate((index) => {
  const canvas = document.querySelectorAll('.six canvas')[index];
  const {data} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  let vision = 0, navigation = 0;
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] < 200) continue;
    vision += Number(data[i] > data[i + 2] + 100);
    navigation += Number(data[i + 2] > data[i] + 100);
  }
  return {vision, navigation};
}, plot);

await inChromium(async (browser) => {
  run(program('perch-simulate'), ['--config', 'flight.yaml', '--output', 'landing']);
  const live = await start('landing/perch.yaml', '127.0.0.1:0', '--set', 'camera.source=flight:landing', '--output', 'again');
  const page = await watch(browser, `http://127.0.0.1:${live.port}/`, DESK);
  await until('TRACK', async () => (await badge(page)) === 'TRACK');
  assert.match(await page.textContent('.title'), /^replay of flight:/);
  await until('its end', () => live.exitCode !== null, 80);
  assert.equal(live.exitCode, 0, live.log);
  await until('NO LINK', async () => (await badge(page)) === 'NO LINK');

  // What was seen is still there, all of it: the flight is shorter than the stretch of 30 s.
  const exported = await csv(page);
  const compared = equalsTheFiles(exported, 'again', 120);
  const navigation = navigationIn(readFileSync(join(folder, 'landing/perch.yaml'), 'utf8'));
  let over = 0;
  for (const row of exported.rows) {
    const expected = navigation(BigInt(row[0]));
    if (!expected) continue;
    // Between samples, 20 ms apart, 2 m/s^2 bend the way by 0.1 mm; their noise of 2 cm, and a velocity's of 5 cm/s, with which
    // Perch bends it, too, by a few tenths. Another sample would be off by centimetres.
    ['nav_x', 'nav_y', 'nav_z'].forEach((name, i) => assert.ok(Math.abs(Number(exported.at(row, name)) - expected[i]) < 2e-3, `${name} of ${row[0]}: ${exported.at(row, name)}, not ${expected[i]}`));
    ++over;
  }
  assert.ok(over > 120, `navigation in ${over} rows`);
  console.log(`${compared} rows equal the files, ${over} have navigation's place`);
  for (const plot of [0, 2, 3]) {
    const {vision, navigation: blue} = await coloured(page, plot);
    assert.ok(vision > 100 && blue > 100, `plot ${plot}: ${vision} pixels of vision, ${blue} of navigation`);
  }
  await shoot(page, 'replay_light');

  // Paused at a frame, the numerals are that frame's.
  await press(page, 'Shift+ArrowLeft', 'Shift+ArrowLeft', 'Shift+ArrowLeft');
  await until('three seconds back', async () => Math.abs((await seconds(page)) + 3) < 0.051);
  const last = BigInt(exported.rows.at(-1)[0]);
  const row = exported.rows.findLast(([ns]) => BigInt(ns) <= last - 3_000_000_000n);
  for (const name of ['x', 'y', 'z']) {
    await until(`the ${name} of then`, async () => (await page.textContent(`#value-${name}`)).replace('−', '-') === Number(exported.at(row, name)).toFixed(2));
  }
  assert.match(await fact(page, 'frame'), /pose of \d+ features/);
  // A plot is clicked where it is a second before its right end.
  const plot = await page.locator('.six .u-over').first().boundingBox();
  await page.mouse.click(plot.x + plot.width * 0.5, plot.y + plot.height / 2);
  await until('another moment', async () => !(await page.textContent('#when')).startsWith('−3.0'));
});
