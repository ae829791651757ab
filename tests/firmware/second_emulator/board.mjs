// The firmware's image in rp2040js, on virtual time: flash and boot ROM, pacing of the PIO, and the bits on the LED pin.
import { RP2040 } from 'rp2040js';
import { Flash, Rom, romImage } from './flash.mjs';
import { Host } from './host.mjs';

const LED_PIN = 2, TEMPERATURE = 881, BOOT2_AT = 0x20041f00, RING_OSCILLATOR_HZ = 6.5e6;
const NTC_PIN = 26, PULL_OHM = 60e3, PULL_DOWN = 1 << 2, PULL_UP = 1 << 3, DIGITAL_ON = 1 << 6, OUTPUT_OFF = 1 << 7;
const ONE_NS = 500, FRAME_END_NS = 50_000;

export class Board {
  constructor(cells, uniqueId) {
    this.cells = cells;
    this.uniqueId = uniqueId;
    this.log = [];
    this.faults = [];
    this.past = 0;
    this.powerOn();
  }

  get nanos() {
    return this.past + (this.mcu?.clock.nanos ?? 0);
  }

  fault(text) {
    if (this.faults.length < 20) this.faults.push(`${(this.nanos / 1e3).toFixed(1)} us: ${text}`);
  }

  powerOn() {
    this.past = this.nanos;
    const mcu = this.mcu = new RP2040();
    const warn = (...words) => this.fault(`rp2040js: ${words.join(' ')}`);
    mcu.logger = { debug() {}, info() {}, warn, error: warn };
    mcu.loadBootrom(romImage());
    this.flash = new Flash(this, this.cells, this.uniqueId);
    mcu.peripherals[0x18000] = this.flash.ssi;
    mcu.peripherals[0x40018] = this.flash.select;
    this.rom = new Rom(this);
    mcu.onBreak = (code) => this.rom.call(code);
    mcu.adc.channelValues[4] = TEMPERATURE;
    this.wireNtc();
    mcu.peripherals[0x40058].onWatchdogTrigger = () => this.fault('the watchdog bites');
    this.watchFlash();
    this.pace();
    this.host = new Host(this);
    this.nextFrame = 1e6;
    mcu.clkSys = RING_OSCILLATOR_HZ;
    for (let i = 0; i < 256; i++) mcu.sram[BOOT2_AT - 0x20000000 + i] = this.cells[i];
    Object.assign(mcu.core, { SP: BOOT2_AT, PC: BOOT2_AT });
  }

  // The NTC of the ring: 10 kohm to the supply, `ntcOhm` to ground, and what the pad pulls; without one the pad alone.
  wireNtc() {
    const { adc, gpio } = this.mcu, convert = adc.onADCRead;
    adc.onADCRead = (channel) => {
      if (channel === 0) adc.channelValues[0] = this.ntcReading(gpio[NTC_PIN].padValue);
      convert(channel);
    };
  }

  ntcReading(pad) {
    if (pad & DIGITAL_ON || !(pad & OUTPUT_OFF)) this.fault(`GPIO${NTC_PIN} is converted as a digital pin`);
    const there = this.ntcOhm !== undefined;
    const up = (there ? 1 / 10e3 : 0) + (pad & PULL_UP ? 1 / PULL_OHM : 0);
    const down = (there ? 1 / this.ntcOhm : 0) + (pad & PULL_DOWN ? 1 / PULL_OHM : 0);
    return up + down ? Math.min(4095, Math.floor(up / (up + down) * 4096)) : 0;
  }

  watchFlash() {
    const { mcu, flash } = this;
    const view = new DataView(flash.cells.buffer);
    for (const [name, get] of [['readUint32', 'getUint32'], ['readUint16', 'getUint16'], ['readUint8', 'getUint8']]) {
      const plain = mcu[name].bind(mcu);
      mcu[name] = (address) => {
        if (address < 0x10000000 || address >= 0x14000000) return plain(address);
        if (!flash.readable) this.fault(`flash is read at ${address.toString(16)} while it cannot be`);
        return view[get](address % flash.cells.length, true);
      };
    }
  }

  // rp2040js lets the PIO run by a timer of JavaScript, whatever its divider: here each instruction has its time.
  pace() {
    const { mcu } = this;
    for (const pio of mcu.pio) pio.run = () => {};
    this.pioAt = 0;
    this.edges = [];
    this.level = 0;
    mcu.gpio[LED_PIN].addListener((state) => {
      const level = state === 1 ? 1 : 0;
      if (level !== this.level) this.edges.push(this.past + this.pioAt);
      this.level = level;
    });
  }

  advancePio() {
    const pio = this.mcu.pio[0], [machine] = pio.machines, now = this.mcu.clock.nanos;
    const period = 1e9 / this.mcu.clkSys * (machine.clockDivInt || 65536);
    while (machine.enabled && !pio.stopped && !machine.waiting && this.pioAt <= now) {
      const before = machine.cycles;
      pio.step();
      this.pioAt += (machine.cycles - before) * period;
    }
    if (machine.waiting || !machine.enabled) this.pioAt = Math.max(this.pioAt, now);
  }

  pass(nanos) {
    this.mcu.clock.tick(nanos);
    this.advancePio();
    if (this.mcu.clock.nanos >= this.nextFrame) {
      this.nextFrame += 1e6;
      this.host.startOfFrame();
    }
    if (this.edges.length && this.nanos - this.edges.at(-1) > FRAME_END_NS && !this.level) this.frame();
  }

  step(end) {
    const { mcu } = this;
    if (!mcu.core.waiting) return this.pass(mcu.core.executeInstruction() / mcu.clkSys * 1e9);
    const alarm = mcu.clock.nextAlarm ? mcu.clock.nanosToNextAlarm : Infinity;
    const busy = this.edges.length || mcu.dma.channels[0].active;
    return this.pass(Math.max(8, Math.min(alarm, this.nextFrame - mcu.clock.nanos, end - this.nanos, busy ? 500 : Infinity)));
  }

  // What the LEDs were told: the bits, and how long their pulses were.
  frame() {
    const highs = { 0: [], 1: [] }, lows = { 0: [], 1: [] };
    let bits = '';
    for (let i = 0; i + 1 < this.edges.length; i += 2) {
      const high = this.edges[i + 1] - this.edges[i], bit = high > ONE_NS ? 1 : 0;
      bits += bit;
      highs[bit].push(high);
      if (i + 2 < this.edges.length) lows[bit].push(this.edges[i + 2] - this.edges[i + 1]);
    }
    const range = (values) => values.length ? [Math.min(...values), Math.max(...values)] : [];
    this.log.push({ us: this.edges[0] / 1e3, bits, pulses: [highs[0], lows[0], highs[1], lows[1]].map(range) });
    this.edges = [];
  }

  run(micros, reached = () => false) {
    for (const end = this.nanos + micros * 1e3; this.nanos < end;) {
      for (let i = 0; i < 16; i++) this.step(end);
      if (reached()) return true;
    }
    return reached();
  }
}
