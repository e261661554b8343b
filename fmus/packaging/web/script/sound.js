// The sound of stick-slip: the friction force, played faster.

const SPEED_UP = 1000; // so that one slip a second has a tone of 1 kHz
const LARGE = 0.98; // of the largest value
const [ARMED, RELEASED] = [0.25, 0.75]; // of the range of the force: a cycle begins with a rise past both
const [SECONDS, FADE, VOLUME] = [1.5, 0.05, 0.15];
const MAX_SAMPLES = 480000;

// The times in s at which cycles of a force begin; those up to its largest value are left out, because they depend on the
// start.
export function cycleStarts(time, force) {
  const high = force.reduce((largest, value) => Math.max(largest, value), -Infinity);
  const first = force.findIndex((value) => value >= LARGE * high);
  const low = force.slice(first).reduce((least, value) => Math.min(least, value), Infinity);
  const level = (fraction) => low + fraction * (high - low);
  const starts = [];
  let isArmed = false;
  for (let row = first; row < force.length; row++) {
    if (force[row] < level(ARMED)) isArmed = true;
    if (!isArmed || force[row] <= level(RELEASED)) continue;
    starts.push(time[row]);
    isArmed = false;
  }
  return starts;
}

export class StickSlipSound {
  constructor() {
    Object.assign(this, { isOn: false, context: null, source: null, samples: null, text: "" });
  }

  // Play the friction on a body, again and again for a moment. `text` is a sentence about the sound.
  play(run, body) {
    this.stop();
    this.isOn = true;
    this.text = "There is no sound: the run has no two whole cycles of stick and slip.";
    const starts = cycleStarts(run.time, run.columns[body.friction]);
    if (starts.length < 2) return;
    const period = (starts.at(-1) - starts[0]) / (starts.length - 1);
    this.context ??= new AudioContext(); // at a click, as browsers demand
    const { context } = this;
    context.resume();
    this.samples = sampleForce(run, body.friction, starts[0], starts.at(-1), context.sampleRate);
    const buffer = context.createBuffer(1, this.samples.length, context.sampleRate);
    buffer.copyToChannel(this.samples, 0);
    const gain = context.createGain();
    const now = context.currentTime;
    gain.gain.setValueAtTime(0, now);
    gain.gain.linearRampToValueAtTime(VOLUME, now + FADE);
    gain.gain.setValueAtTime(VOLUME, now + SECONDS - FADE);
    gain.gain.linearRampToValueAtTime(0, now + SECONDS);
    this.source = context.createBufferSource();
    Object.assign(this.source, { buffer, loop: true });
    this.source.connect(gain).connect(context.destination);
    this.source.start(now);
    this.source.stop(now + SECONDS);
    const tone = SPEED_UP / period;
    this.text = `Sound: the friction force, ${SPEED_UP} times faster. One slip every ${Number(period.toPrecision(3))} s becomes a tone of ${Number(tone.toPrecision(3))} Hz.`;
  }

  stop() {
    this.isOn = false;
    this.source?.stop();
    this.source = null;
  }
}

// Samples of a force between two times, between -1 and 1, with a mean of zero.
function sampleForce(run, name, from, to, rate) {
  const count = Math.min(Math.max(Math.round(((to - from) / SPEED_UP) * rate), 2), MAX_SAMPLES);
  const samples = Float32Array.from({ length: count }, (_, i) => run.at(name, from + ((to - from) * i) / count));
  const mean = samples.reduce((sum, value) => sum + value, 0) / count;
  const largest = samples.reduce((size, value) => Math.max(size, Math.abs(value - mean)), 0) || 1;
  return samples.map((value) => (value - mean) / largest);
}
