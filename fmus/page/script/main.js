// The page: the stories and Explore, the address, and keys.

import { Explore, isEmbedded } from "./explore.js";
import { ModelLibrary } from "./library.js";
import { OPENING, STORIES } from "./stories.js";
import { createSection, Story } from "./story.js";

const data = JSON.parse(document.getElementById("data").textContent);
const library = new ModelLibrary(data);
const host = document.getElementById("stories");
const opening = host && new Story(document.getElementById("opening"), library, OPENING);
const explore = new Explore(document.querySelector("main"), library);
const stories = host ? Object.entries(STORIES).map(([id, story]) => new Story(createSection(id, story.title), library, story)) : [];

document.getElementById("version").textContent = data.version;
addEventListener("hashchange", ({ newURL }) => { // the state may have replaced the address since
  const { hash } = new URL(newURL);
  if (/^#[a-z]/.test(hash)) return; // a part of the page
  if (hash !== explore.link) explore.follow(hash);
});
addEventListener("keydown", (event) => {
  if (event.key !== " " || event.target.closest("button, input, select, summary, a, [role=slider]")) return;
  const { top, bottom } = document.getElementById("stage").getBoundingClientRect();
  if (bottom < 0 || top > innerHeight) return; // the space bar scrolls
  event.preventDefault();
  document.getElementById("play").click();
});
host?.addEventListener("click", (event) => { // in a page embedded in a report, a link would lead to the report
  const hash = event.target.closest("a")?.getAttribute("href");
  if (!hash || !isEmbedded) return;
  event.preventDefault();
  if (hash.startsWith("#.")) explore.follow(hash);
  else document.querySelector(hash).scrollIntoView();
});
globalThis.app = { library, opening, stories, runs: explore.runs, plots: explore.diagrams.plots, seek: (t) => explore.seek(t), state: () => explore.state }; // for tests and the console
await Promise.all([opening?.start(), explore.follow(location.hash)]);
await new Promise(requestAnimationFrame); // the first picture is drawn before another model is compiled
for (const story of stories) await story.start();
