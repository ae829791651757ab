// A serial flash chip behind the SSI, and the functions of the boot ROM that reach it by real transfers on that bus.
const SIZE = 2 << 20;
const SSI = 0x18000000;
const CHIP_SELECT = 0x4001800c;
const ERASE_MS = 45;
const PROGRAM_MS = 0.7;

// Registers that are plain memory, but for what `written` and `asked` do.
class Block {
  constructor(written, asked) {
    this.words = new Map();
    this.written = written;
    this.asked = asked;
  }

  readUint32(offset) {
    return this.asked?.(offset) ?? this.words.get(offset) ?? 0;
  }

  writeUint32(offset, value) {
    this.words.set(offset, value >>> 0);
    this.written?.(offset, value >>> 0);
  }

  writeUint32Atomic(offset, value, how) {
    const before = how ? this.readUint32(offset) : 0;
    this.writeUint32(offset, [value, before ^ value, before | value, before & ~value][how]);
  }
}

export class Flash {
  constructor(board, cells, uniqueId) {
    this.board = board;
    this.cells = cells;
    this.uniqueId = uniqueId;
    this.shift = []; // bytes of the command since chip select fell
    this.came = [];
    this.idleAt = 0;
    this.writable = false;
    this.ssi = new Block((offset, value) => this.ssiWritten(offset, value), (offset) => this.ssiAsked(offset));
    this.select = new Block((offset, value) => offset === 0xc && this.selected(value >> 8 & 3));
    for (const [offset, value] of [[0x08, 1], [0x00, 0x70000], [0x14, 6], [0x10, 1]]) this.ssi.words.set(offset, value);
  }

  get busy() {
    return this.board.nanos < this.idleAt;
  }

  ssiAsked(offset) {
    if (offset === 0x28) return 6 | (this.came.length ? 8 : 0);
    if (offset !== 0x60) return undefined;
    if (!this.came.length) this.board.fault('the SSI is read while nothing has come');
    return this.came.shift() ?? 0;
  }

  ssiWritten(offset, value) {
    const on = this.ssi.words.get(0x08);
    if (on && [0x00, 0x04, 0x14, 0xf4].includes(offset)) this.board.fault(`SSI register ${offset} is set while it is on`);
    if (offset === 0x08 && !value) this.came.length = 0;
    if (offset !== 0x60) return;
    if (!on || this.ssi.words.get(0x00) !== 0x70000) this.board.fault('a byte goes to an SSI that is not set up for it');
    this.came.push(this.exchange(value & 255));
  }

  selected(override) {
    const low = override === 2;
    if (this.low && !low) this.commandEnds();
    this.low = low;
    this.shift = [];
  }

  exchange(byte) {
    if (!this.low) return 0xff;
    if (!this.shift.length && this.busy && byte !== 5) this.board.fault(`flash command ${byte} while it is busy`);
    this.shift.push(byte);
    const place = this.shift.length - 1;
    if (place === 0) return 0xff;
    if (this.shift[0] === 5) return (this.busy ? 1 : 0) | (this.writable ? 2 : 0);
    if (this.shift[0] === 0x4b) return this.uniqueId[place - 5] ?? 0xff;
    return 0xff;
  }

  commandEnds() {
    const [command, high, middle, low, ...data] = this.shift;
    const address = (high << 16 | middle << 8 | low) % SIZE;
    if (command === 6) this.writable = true;
    if (command !== 0x20 && command !== 2) return;
    if (!this.writable) return this.board.fault('the flash is written without its write enable');
    this.writable = false;
    if (command === 0x20) this.cells.fill(0xff, address & ~4095, (address & ~4095) + 4096);
    else data.forEach((value, i) => { this.cells[address & ~255 | address + i & 255] &= value; });
    this.idleAt = this.board.nanos + (command === 0x20 ? ERASE_MS : PROGRAM_MS) * 1e6;
  }

  // Whether the processor sees the flash: serial reads by 03h, 24 bits of address, words of 32 bits.
  get readable() {
    const word = (offset) => this.ssi.words.get(offset) ?? 0;
    return word(0x08) === 1 && word(0x00) === 0x1f0300 && word(0xf4) === 0x03000218 && word(0x04) === 0 &&
      word(0x14) >= 2 && !((this.select.words.get(0xc) ?? 0) >> 8 & 3) && !this.busy;
  }
}

// The boot ROM as far as the firmware uses it. Each function is a breakpoint, which calls the JavaScript, and a return.
export const ROM_FUNCTIONS = ['IF', 'EX', 'RE', 'RP', 'FC', 'CX', 'UB'];

export function romImage() {
  const rom = new DataView(new ArrayBuffer(16384));
  const put = (at, ...halves) => halves.forEach((half, i) => rom.setUint16(at + 2 * i, half, true));
  put(0x14, 0x400, 0, 0x101);
  ROM_FUNCTIONS.forEach((name, i) => {
    put(0x400 + 4 * i, name.charCodeAt(0) | name.charCodeAt(1) << 8, 0x600 + 4 * i | 1);
    put(0x600 + 4 * i, 0xbe00 | i, 0x4770);
  });
  // lookup(r0 table, r1 code): ldrh r2,[r0]; cmp r2,r1; beq found; cmp r2,#0; beq none; adds r0,#4; b; ldrh r0,[r0,#2]
  put(0x100, 0x8802, 0x428a, 0xd003, 0x2a00, 0xd003, 0x3004, 0xe7f8, 0x8840, 0x4770, 0x2000, 0x4770);
  return new Uint32Array(rom.buffer);
}

export class Rom {
  constructor(board) {
    this.board = board;
    this.mcu = board.mcu;
    this.calls = [];
  }

  call(index) {
    const name = ROM_FUNCTIONS[index];
    const [r0, r1, r2] = this.mcu.core.registers;
    this.calls.push(name);
    if (name === 'IF') this.force(0);
    else if (name === 'EX') this.setUp(6, 0x70000, 0), this.force(3);
    else if (name === 'RE') for (let at = r0; at < r0 + r1; at += 4096) this.change(0x20, at, []);
    else if (name === 'RP') for (let at = 0; at < r2; at += 256) this.change(2, r0 + at, this.mcu.sram.slice(r1 + at - 0x20000000, r1 + at - 0x20000000 + 256));
    else if (name === 'FC') this.force(0);
    else if (name === 'CX') this.setUp(4, 0x1f0300, 0x03000218);
    else this.board.fault(`boot ROM function ${name ?? index}`);
  }

  force(override) {
    this.mcu.writeUint32(CHIP_SELECT, override << 8);
  }

  setUp(divider, frames, command) {
    for (const [offset, value] of [[0x08, 0], [0x14, divider], [0x00, frames], [0x04, 0], [0xf4, command], [0x10, 1], [0x08, 1]]) this.mcu.writeUint32(SSI + offset, value);
  }

  transfer(bytes) {
    this.force(2);
    const came = [...bytes].map((byte) => {
      this.mcu.writeUint32(SSI + 0x60, byte);
      this.board.pass(8 * 6 / this.mcu.clkSys * 1e9);
      return this.mcu.readUint32(SSI + 0x60);
    });
    this.force(3);
    return came;
  }

  change(command, at, data) {
    this.transfer([6]);
    this.transfer([command, at >> 16 & 255, at >> 8 & 255, at & 255, ...data]);
    while (this.transfer([5, 0])[1] & 1) this.board.pass(1e5);
  }
}
