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
    /** @type {ArrayBuffer[]} */
    this.parts = [];  // of a picture that is on its way
    /** @type {number|null} */
    this.missing = null;  // the first row of a gap that is being filled
    /** @type {WebSocket|null} */
    this.socket = null;
    this.open();
    setInterval(() => this.checkSilence(), 1000);
  }

  open() {
    this.messages = 0;
    this.parts = [];
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
    const [kind, whole] = new Uint8Array(data, 0, 2);
    if (kind === 1) this.store.addRows(data, this.hello.row_bytes);
    if (kind === 1 && whole) this.missing = null;
    if (kind === 1) return this.tell('rows');
    this.parts.push(data.slice(4));
    if (!whole) return;
    new Blob(this.parts.splice(0)).arrayBuffer().then((picture) => {
      this.store.addPicture(picture);
      this.tell('picture');
    });
  }

  hearText(message) {
    if (message.hello) this.greet(message.hello);
    if (message.status) this.tell('status', message.status);
    if (message.event) this.tell('event', message.event);
  }

  greet(hello) {
    // Another run of the program counts its frames anew.
    if (hello.session !== this.session) {
      this.store.clear();
      this.missing = null;
    }
    this.session = hello.session;
    this.hello = hello;
    this.retry = FIRST_RETRY_MS;
    this.connected = true;
    // Cut off while a gap was being filled, the newest first: its rest is still missing.
    this.missing ??= this.store.next;
    this.send({from: {session: hello.session, sequence: this.missing}});
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
    if (!this.connected) this.askForLogIn();
    this.connected = false;
    this.tell('lost');
    setTimeout(() => this.open(), this.retry);
    this.retry = Math.min(2 * this.retry, LAST_RETRY_MS);
  }

  // A socket says nothing of why it was refused: a page that is led to the log-in does.
  async askForLogIn() {
    const answer = await fetch('/', {method: 'HEAD', redirect: 'manual', cache: 'no-store'}).catch(() => null);
    if (answer?.type === 'opaqueredirect') this.tell('logged out');
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
