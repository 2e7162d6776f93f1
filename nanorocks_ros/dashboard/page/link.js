// The live connection: found again when it is lost, and every step acknowledged once it is taken.

const SHORTEST_MS = 500;
const LONGEST_MS = 5000;

export class Link {
  /** `handlers`: greeted, step, picture, and state with one of waiting, open, lost. */
  constructor(handlers) {
    this.handlers = handlers;
    this.pause = SHORTEST_MS;
    this.look = null;
    this.connect();
  }

  connect() {
    const url = new URL('live', location.href);
    url.protocol = url.protocol === 'https:' ? 'wss:' : 'ws:';
    url.search = '';
    url.hash = '';
    const socket = new WebSocket(url);
    socket.binaryType = 'arraybuffer';
    let greeted = false;
    socket.onmessage = (event) => {
      if (event.data instanceof ArrayBuffer) {
        this.handlers.picture(event.data);
        return;
      }
      const said = JSON.parse(event.data);
      if (!greeted) {
        greeted = true;
        this.socket = socket;
        this.pause = SHORTEST_MS;
        this.handlers.greeted(said);
        this.handlers.state('open');
        this.send({ look: this.look });
        return;
      }
      this.handlers.step(said);
      this.send({ seen: said.n });
    };
    socket.onclose = () => {
      this.socket = null;
      this.handlers.state('lost');
      setTimeout(() => this.again(), this.pause);
      this.pause = Math.min(2 * this.pause, LONGEST_MS);
    };
  }

  /** Connect again; a page whose token is not the right one any more has to ask for it. */
  async again() {
    try {
      const answer = await fetch('style.css', { cache: 'no-store' });
      const inside = answer.ok && (await fetch('app.js', { cache: 'no-store' }));
      if (inside && inside.status === 401) {
        location.assign('login');
        return;
      }
    } catch {
      // Nobody there yet: the connection says the same.
    }
    this.connect();
  }

  send(said) {
    if (this.socket?.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(said));
  }

  /** Say what is looked at, now and after every new connection. */
  lookAt(look) {
    if (JSON.stringify(look) === JSON.stringify(this.look)) return;
    this.look = look;
    this.send({ look });
  }
}
