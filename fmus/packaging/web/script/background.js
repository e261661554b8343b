// Work that may take seconds: tasks run in slices while the browser is idle, the latest task first.

const TASK_SLICE = 8; // ms
const LONGEST_WAIT = 100; // ms
const tasks = new Map();
let isScheduled = false;

// Call advance(deadline) until it returns true; the deadline is in ms of the clock of the page. A task replaces the one with
// the same key.
export function runInBackground(key, advance) {
  tasks.delete(key);
  tasks.set(key, advance);
  schedule();
}

export function cancelTask(key) {
  tasks.delete(key);
}

function schedule() {
  if (isScheduled || !tasks.size) return;
  isScheduled = true;
  if (globalThis.requestIdleCallback) requestIdleCallback(runSlice, { timeout: LONGEST_WAIT });
  else setTimeout(runSlice);
}

function runSlice() {
  isScheduled = false;
  const [key, advance] = [...tasks].at(-1) ?? [];
  if (advance?.(performance.now() + TASK_SLICE) && tasks.get(key) === advance) tasks.delete(key);
  schedule();
}

// Wait until the browser is idle.
export function becomeIdle() {
  return new Promise((done) => (globalThis.requestIdleCallback ? requestIdleCallback(done, { timeout: LONGEST_WAIT }) : setTimeout(done)));
}
