// A radio between browser and server: a TCP proxy that passes so many kbit/s each way, 50 ms late, and holds little.
import net from 'node:net';

const TICK_MS = 10, DELAY_MS = 50, HELD = 2000;  // bytes that a modem takes in before it says stop

export class Radio {
  /** Kilobits a second each way, over all connections; 0: no limit. */
  kbit = 0;
  #away = false;
  #links = new Set();

  static async to(port) {
    const radio = new Radio();
    radio.server = net.createServer((near) => radio.#connect(near, port));
    await new Promise((done) => radio.server.listen(0, '127.0.0.1', () => done(null)));
    radio.port = radio.server.address().port;
    radio.timer = setInterval(() => radio.#pass(), TICK_MS);
    return radio;
  }

  // Nothing gets through, and who tries is refused.
  cut(away) {
    this.#away = away;
    if (away) for (const {near, far} of this.#links) [near, far].forEach((socket) => socket.destroy());
  }
  close() {
    clearInterval(this.timer);
    this.cut(true);
    this.server.close();
  }

  #connect(near, port) {
    if (this.#away) return near.destroy();
    const far = net.connect(port, '127.0.0.1');
    const link = {near, far, ways: [this.#way(near, far), this.#way(far, near)]};
    this.#links.add(link);
    for (const [one, other] of [[near, far], [far, near]]) {
      one.setNoDelay(true);
      one.on('error', () => {});
      one.on('close', () => {
        this.#links.delete(link);
        setTimeout(() => other.destroy(), 1000);  // what is on its way gets there
      });
    }
  }

  #way(from, to) {
    const way = {to, queue: [], bytes: 0, from};
    from.on('data', (data) => {
      way.queue.push(data);
      way.bytes += data.length;
      if (this.kbit && way.bytes > HELD) from.pause();
    });
    return way;
  }

  // In turn from each connection, a packet at a time.
  #pass() {
    // What time it is tells how much: on a machine that others load a tick may come late.
    const now = performance.now(), ms = now - (this.passed ?? now);
    this.passed = now;
    for (const direction of [0, 1]) {
      this.room ??= [0, 0];
      const rate = this.kbit / 8;  // bytes a ms
      this.room[direction] = rate ? Math.min(this.room[direction] + rate * ms, rate * Math.max(5 * TICK_MS, ms)) : Infinity;
      const ways = [...this.#links].map((link) => link.ways[direction]);
      for (let moved = true; moved && this.room[direction] > 0;) {
        moved = false;
        for (const way of ways) {
          if (!way.queue.length || this.room[direction] <= 0) continue;
          const packet = way.queue[0].subarray(0, 500);
          way.queue[0] = way.queue[0].subarray(packet.length);
          if (!way.queue[0].length) way.queue.shift();
          way.bytes -= packet.length;
          this.room[direction] -= packet.length;
          moved = true;
          setTimeout(() => way.to.writable && way.to.write(packet), DELAY_MS);
          if (way.bytes <= HELD) way.from.resume();
        }
      }
    }
  }
}
