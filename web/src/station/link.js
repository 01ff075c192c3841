// The WebSocket: comes again by itself, acknowledges each message, and asks for what it missed.

// The server says how it goes twice a second: silence is a broken link.
const SILENCE_MS = 8000;
const FIRST_RETRY_MS = 500, LAST_RETRY_MS = 5000;

export class Link extends EventTarget {
  /** @param {import('./store.js').Store} store */
  constructor(store) {
    super();
    this.store = store;
    this.session = '';
    this.view = {grey: true, binary: true, close: false};
    this.retry = FIRST_RETRY_MS;
    this.bytes = 0;
    this.connected = false;
    /** @type {any} */
    this.hello = null;
    this.messages = 0;
    this.heard = 0;
    /** @type {WebSocket|null} */
    this.socket = null;
    this.open();
    setInterval(() => this.checkSilence(), 1000);
  }

  open() {
    this.messages = 0;
    this.heard = performance.now();
    const scheme = location.protocol === 'https:' ? 'wss' : 'ws';
    const socket = this.socket = new WebSocket(`${scheme}://${location.host}/live`);
    socket.binaryType = 'arraybuffer';
    socket.onmessage = (event) => { if (socket === this.socket) this.hear(event.data); };
    socket.onclose = () => { if (socket === this.socket) this.lost(); };
  }

  hear(data) {
    this.heard = performance.now();
    this.bytes += data.byteLength ?? data.length;
    this.send({ack: ++this.messages});
    if (typeof data === 'string') return this.hearText(JSON.parse(data));
    const kind = new Uint8Array(data, 0, 1)[0];
    if (kind === 1) this.store.addRows(data, this.hello.row_bytes);
    if (kind === 2) this.store.addPicture(data);
    this.tell(kind === 1 ? 'rows' : 'picture');
  }

  hearText(message) {
    if (message.hello) this.greet(message.hello);
    if (message.status) this.tell('status', message.status);
    if (message.event) this.tell('event', message.event);
  }

  greet(hello) {
    // Another run of the program counts its frames anew.
    if (hello.session !== this.session) this.store.clear();
    this.session = hello.session;
    this.hello = hello;
    this.retry = FIRST_RETRY_MS;
    this.connected = true;
    this.send({from: {session: hello.session, sequence: this.store.next}});
    this.send({view: this.view});
    this.tell('hello', hello);
  }

  setView(view) {
    this.view = {...this.view, ...view};
    this.send({view: this.view});
  }

  send(message) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  lost() {
    this.connected = false;
    this.tell('lost');
    setTimeout(() => this.open(), this.retry);
    this.retry = Math.min(2 * this.retry, LAST_RETRY_MS);
  }

  checkSilence() {
    if (!this.connected || performance.now() - this.heard < SILENCE_MS) return;
    const silent = this.socket;
    this.socket = null;
    silent?.close();
    this.lost();
  }

  tell(type, detail) {
    this.dispatchEvent(new CustomEvent(type, {detail}));
  }
}
