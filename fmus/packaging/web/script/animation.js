// One loop of animation frames for everything that moves in the stories; it rests when nothing does.

const LONGEST_STORY_FRAME = 0.05; // s
const callbacks = new Set();
let lastAnimationFrame = 0; // ms
export const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)");

function animationFrame(now) {
  const elapsed = Math.min(Math.max(now - lastAnimationFrame, 0) / 1000, LONGEST_STORY_FRAME);
  lastAnimationFrame = now;
  for (const callback of [...callbacks]) if (callback(elapsed) === false) callbacks.delete(callback);
  if (callbacks.size) requestAnimationFrame(animationFrame);
}

// Call a function in every frame with the elapsed time in s, until it returns false.
export function animate(callback) {
  if (!callbacks.size) {
    lastAnimationFrame = performance.now();
    requestAnimationFrame(animationFrame);
  }
  callbacks.add(callback);
}

export function stopAnimation(callback) {
  callbacks.delete(callback);
}
