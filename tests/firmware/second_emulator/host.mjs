// The other end of the USB cable: enumerates, opens the serial port, and keeps account of every data toggle.
const AVAILABLE = 0x400, STALL = 0x800, DATA1 = 0x2000;
const SUSPENDED = 1 << 4, RESUME = 1 << 11, SOF = 1 << 17;

export class Host {
  constructor(board) {
    const usb = board.mcu.usbCtrl;
    Object.assign(this, { board, usb, queue: [], current: null, answers: {}, bytes: [], waiting: [], room: 0, ready: false });
    usb.onUSBEnabled = () => usb.resetDevice();
    usb.onResetReceived = () => this.enumerate();
    usb.onEndpointWrite = (endpoint, data) => this.sent(endpoint, [...data]);
    usb.onEndpointRead = (endpoint, room) => this.armed(endpoint, room);
    this.wrapRegisters();
  }

  wrapRegisters() {
    const { usb, board } = this;
    const handed = usb.DPRAMUpdated.bind(usb), read = usb.readUint32.bind(usb), write = usb.writeUint32.bind(usb);
    usb.DPRAMUpdated = (offset, value) => {
      if (offset >= 0x80 && offset < 0x100) this.word(offset, value);
      handed(offset, value);
    };
    usb.readUint32 = (offset) => {
      if (offset !== 0x48) return read(offset);
      usb.intRaw &= ~SOF;
      usb.checkInterrupts();
      return Math.floor(board.nanos / 1e6) & 0x7ff;
    };
    usb.writeUint32 = (offset, value) => {
      if (offset === 0x50 && usb.rawWriteValue & SUSPENDED) usb.sieStatus &= ~SUSPENDED;
      write(offset, value);
    };
    this.toggles = new Map();
    this.pids = new Map();
  }

  // A word of buffer control: which data packet it is, and whether endpoint 0 refuses.
  word(offset, value) {
    if (value & AVAILABLE && !(offset & 4)) (this.pids.get(offset) ?? this.pids.set(offset, []).get(offset)).push(!!(value & DATA1));
    if (offset === 0x80 && value & STALL && this.current) {
      if (!(this.usb.epStallArm & 1)) this.board.fault('endpoint 0 stalls without EP_STALL_ARM');
      this.done(null);
    }
  }

  startOfFrame() {
    if (this.suspended) return;
    this.usb.intRaw |= SOF;
    this.usb.checkInterrupts();
  }

  control(name, type, request, value, index, length, data) {
    this.queue.push({ name, type, request, value, index, length, data, came: [], stage: type & 0x80 ? 'in' : data ? 'out' : 'status' });
    if (!this.current) this.next();
  }

  next() {
    this.current = this.queue.shift() ?? null;
    if (!this.current) return;
    const { type, request, value, index, length } = this.current;
    this.toggles.set(0x80, true);
    this.pids.set(0x80, []);
    this.statusArmed = false;
    this.usb.epStallArm = 0;
    if (request === 9 && !type) this.toggles.set(0x90, false);
    this.usb.sendSetupPacket(Uint8Array.from([type, request, value & 255, value >> 8, index & 255, index >> 8, length & 255, length >> 8]));
  }

  done(answer) {
    const { name } = this.current;
    this.current = null;
    this.answers[name] = answer && Buffer.from(answer).toString('hex');
    if (name === 'configured') this.ready = true;
    this.next();
  }

  enumerate() {
    Object.assign(this, { queue: [], current: null, ready: false });
    const describe = (name, kind, index, length) => this.control(name, 0x80, 6, kind << 8 | index, kind === 3 && index ? 0x409 : 0, length);
    describe('first', 1, 0, 64);
    this.control('address', 0, 5, 7, 0, 0);
    describe('device', 1, 0, 18);
    describe('head', 2, 0, 9);
    describe('configuration', 2, 0, 255);
    ['languages', 'manufacturer', 'product', 'serial'].forEach((name, index) => describe(name, 3, index, 255));
    this.control('configured', 0, 9, 1, 0, 0);
  }

  open() {
    this.control('coding', 0x21, 0x20, 0, 0, 7, [0x00, 0xc2, 0x01, 0x00, 0, 0, 8]);
    this.control('lines', 0x21, 0x22, 3, 0, 0);
  }

  sent(endpoint, data) {
    const at = 0x80 + 8 * endpoint, expected = this.toggles.get(at) ?? false;
    if (this.pids.get(at)?.shift() !== expected) this.board.fault(`wrong data toggle at endpoint ${endpoint}`);
    this.toggles.set(at, !expected);
    if (endpoint) return this.take(data);
    if (this.current?.stage === 'status') return this.done([]);
    if (this.current?.stage !== 'in') return undefined;
    this.current.came.push(...data);
    if (data.length === 64 && this.current.came.length < this.current.length) return undefined;
    this.current.stage = 'status out';
    return this.statusOut();
  }

  statusOut() {
    if (!this.statusArmed || this.current?.stage !== 'status out') return;
    this.usb.endpointReadDone(0, new Uint8Array(0));
    this.done(this.current.came);
  }

  armed(endpoint, room) {
    if (endpoint) {
      this.room = room;
      this.pump();
    } else if (this.current?.stage === 'out') {
      this.usb.endpointReadDone(0, Uint8Array.from(this.current.data));
      this.current.stage = 'status';
    } else {
      this.statusArmed = true;
      this.statusOut();
    }
  }

  send(data) {
    this.waiting.push(...data);
    this.pump();
  }

  pump() {
    if (!this.room || !this.waiting.length) return;
    const packet = this.waiting.splice(0, this.room);
    this.room = 0;
    this.usb.endpointReadDone(2, Uint8Array.from(packet));
  }

  take(data) {
    for (const byte of data) {
      this.bytes.push(byte);
      if (byte) continue;
      this.board.log.push({ us: this.board.nanos / 1e3, chip_us: this.board.mcu.clock.nanos / 1e3, packet: Buffer.from(this.bytes).toString('hex') });
      this.bytes = [];
    }
  }

  suspend() {
    this.suspended = true;
    this.usb.sieStatus |= SUSPENDED;
    this.usb.sieStatusUpdated();
  }

  resume() {
    this.suspended = false;
    this.usb.sieStatus |= RESUME;
    this.usb.sieStatusUpdated();
  }
}
