// A station that others can reach: the log-in, a wrong token, other sites' pages, a session that ended.
import assert from 'node:assert/strict';
import {createServer} from 'node:http';
import {PHONE, badge, inChromium, shoot, start, stop, target, until, watch, write} from './rig.mjs';

const TOKEN = 'correct-horse+battery%staple';  // a form has to say some of it otherwise
write('token', TOKEN + '\n');
write('run.yaml', `${target}camera: {source: 'sim:sim.yaml'}\noutputs: {station: {token: token}}\n`);

// While one page gives way to another there is none to ask.
const tracks = (page) => badge(page).then((text) => text === 'TRACK', () => false);

async function logIn(page, token) {
  await page.fill('#token', token);
  await page.keyboard.press('Enter');
}

// A page of another site's in the same browser, whose cookies it has: nothing of ours opens to it.
async function foreignSite(context, station) {
  const site = createServer((_, reply) => reply.setHeader('Content-Type', 'text/html').end('<iframe id="frame"></iframe>'));
  await new Promise((done) => site.listen(0, '127.0.0.1', () => done(null)));
  const page = await context.newPage();
  await page.goto(`http://127.0.0.1:${/** @type {any} */ (site.address()).port}/`);
  const [socket, form, read] = await page.evaluate(async ([host, token]) => [
    await new Promise((done) => {
      const one = new WebSocket(`ws://${host}/live`);
      one.onopen = () => done('opened');
      one.onerror = () => done('refused');
    }),
    // Not to be read, but sent: what counts is that no session comes of it.
    await fetch(`http://${host}/login`, {method: 'POST', mode: 'no-cors', credentials: 'include', body: new URLSearchParams({token})}).then(({type}) => type, () => 'refused'),
    await fetch(`http://${host}/station.js`, {credentials: 'include'}).then(() => 'read', () => 'refused'),
  ], [station, TOKEN]);
  assert.equal(socket, 'refused');
  assert.equal(form, 'refused');
  assert.equal(read, 'refused');
  await page.evaluate((host) => { /** @type {any} */ (document.getElementById('frame')).src = `http://${host}/login.html`; }, station);
  await until('the frame is refused', () => page.frames()[1]?.url().startsWith('chrome-error:'));
  await page.close();
  site.close();
}

await inChromium(async (browser) => {
  // All addresses of this machine; one that is not 127.0.0.1 is asked.
  let live = await start('run.yaml', '0.0.0.0:0');
  const host = `127.0.0.2:${live.port}`;
  const page = await watch(browser, `http://${host}/`, PHONE, {colorScheme: 'dark'});
  assert.equal(new URL(page.url()).pathname, '/login.html');
  await shoot(page, 'login_dark');
  const cookies = () => page.context().cookies();

  await foreignSite(page.context(), host);
  assert.equal((await cookies()).length, 0);  // though the token was the right one
  await page.goto(`http://${host}/?token=${encodeURIComponent(TOKEN)}`);
  assert.equal(new URL(page.url()).pathname, '/login.html');

  await logIn(page, 'correct-horse-battery');
  await until('the wrong token is said to be wrong', () => page.isVisible('#wrong'));
  await shoot(page, 'login_wrong');
  assert.equal((await cookies()).length, 0);

  await logIn(page, TOKEN);
  await until('TRACK', () => tracks(page));
  assert.ok(!page.url().includes('token'));
  const [cookie] = await cookies();
  assert.ok(cookie.httpOnly && cookie.sameSite === 'Strict' && /^[0-9a-f]{32}$/.test(cookie.value));
  assert.equal(await page.evaluate(() => document.cookie), '');
  // Nothing that the page loads has it in its address.
  const loaded = await page.evaluate(() => performance.getEntriesByType('resource').map(({name}) => name));
  assert.ok(loaded.length > 2 && loaded.every((name) => !/token|[0-9a-f]{32}/.test(name)), loaded.join(' '));
  await foreignSite(page.context(), host);  // with a session, too

  // Started anew it knows nobody: the page says so, and leads to the log-in.
  await stop(live);
  live = await start('run.yaml', `0.0.0.0:${live.port}`);
  await page.click('#connection a', {timeout: 40000});
  await page.waitForURL("**/login.html");
  await logIn(page, TOKEN);
  await until('TRACK again', () => tracks(page));

  // Ten wrong tokens, and nobody logs in for a minute; whoever has a session goes on.
  const other = await watch(browser, `http://${host}/`, PHONE);
  const statuses = await other.evaluate(async (token) => {
    const post = (one) => fetch('/login', {method: 'POST', redirect: 'manual', body: new URLSearchParams({token: one})}).then(({type, status}) => (type === 'opaqueredirect' ? 303 : status));
    const list = [];
    for (let i = 0; i < 11; ++i) list.push(await post(`wrong-token-number-${i}`));
    return [...list, await post(token)];
  }, TOKEN);
  assert.deepEqual(statuses, [...Array(10).fill(303), 429, 429]);
  await page.reload();
  await until('TRACK still', async () => (await badge(page)) === 'TRACK');
  await stop(live);
});
