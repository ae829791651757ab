// node main.mjs: reads {flash, uniqueId, actions} as JSON from standard input, prints what came of it as JSON.
import { readFileSync } from 'node:fs';
import { Board } from './board.mjs';

const { flash, uniqueId, actions } = JSON.parse(readFileSync(0, 'utf8'));
const cells = new Uint8Array(2 << 20).fill(0xff);
cells.set(Buffer.from(flash, 'base64'));
const board = new Board(cells, Buffer.from(uniqueId, 'hex'));
const does = {
  open: () => { board.run(200_000, () => board.host.ready); board.host.open(); board.run(5_000); },
  send: (hex) => board.host.send(Buffer.from(hex, 'hex')),
  run: (micros) => board.run(micros),
  suspend: () => board.host.suspend(),
  resume: () => board.host.resume(),
  ntc: (ohm) => { board.ntcOhm = ohm; },
  power: () => board.powerOn(),
};
for (const [name, ...values] of actions) {
  board.log.push({ us: board.nanos / 1e3, action: name });
  does[name](...values);
}
const { log, faults, host, rom } = board;
console.log(JSON.stringify({ log, faults, descriptors: host.answers, ready: host.ready, rom: rom.calls, clock: board.mcu.clkSys }));
