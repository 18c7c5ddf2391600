// Plays time: it runs between two ends, and says when it changes.
//
//   new Player(start, stop, { onTime, onState })
//   .time, .playing, .speed      seconds of the run per second
//   .seek(t), .play(), .pause(), .toggle()

export class Player {
  constructor(start, stop, { onTime, onState }) {
    Object.assign(this, { start, stop, onTime, onState, time: start, playing: false, speed: 1 });
  }

  seek(t) {
    this.time = Math.min(Math.max(t, this.start), this.stop);
    this.onTime(this.time);
  }

  play() {
    if (this.playing) return;
    if (this.time >= this.stop) this.seek(this.start);
    this.playing = true;
    this.last = null;
    this.onState();
    requestAnimationFrame((now) => this.tick(now));
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this.onState();
  }

  toggle() { if (this.playing) this.pause(); else this.play(); }

  tick(now) {
    if (!this.playing) return;
    // A page in the background sleeps: time does not jump when it wakes.
    if (this.last !== null) this.seek(this.time + this.speed * Math.min(now - this.last, 250) / 1000);
    this.last = now;
    if (this.time >= this.stop) this.pause();
    else requestAnimationFrame((next) => this.tick(next));
  }
}

// Speeds that a player offers, and the one at which a span [s] takes about half a minute.
export const SPEEDS = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500];

export function usualSpeed(span) {
  return SPEEDS.findLast((speed) => speed <= Math.max(span / 25, 1));
}

// Keys that move the time: what each does with the player and its steps [s].
const KEYS = {
  ArrowLeft: (player, step) => player.seek(player.time - step.small),
  ArrowRight: (player, step) => player.seek(player.time + step.small),
  ArrowDown: (player, step) => player.seek(player.time - step.small),
  ArrowUp: (player, step) => player.seek(player.time + step.small),
  PageDown: (player, step) => player.seek(player.time - step.large),
  PageUp: (player, step) => player.seek(player.time + step.large),
  Home: (player) => player.seek(player.start),
  End: (player) => player.seek(player.stop),
  " ": (player) => player.toggle(),
};

// Controls that need keys themselves: all of them, or only the space bar.
const OWN = "select, textarea, [role=button], input:not([type=checkbox], #time)";
const OWN_SPACE = "button, summary, a, input[type=checkbox]";

// Let keys in a part of the page move a player, but not those that a focused control needs itself.
// `steps()` gives { small, large } [s].
export function listen(part, player, steps) {
  part.addEventListener("keydown", (event) => {
    const act = KEYS[event.key], own = (selector) => event.target.closest?.(selector);
    if (!act || event.ctrlKey || event.altKey || event.metaKey || event.shiftKey) return;
    if (own(OWN) || (event.key === " " && own(OWN_SPACE))) return;
    const scrolls = ["ArrowUp", "ArrowDown", "PageUp", "PageDown"].includes(event.key);
    if (scrolls && !event.target.matches?.("#time")) return;
    event.preventDefault();
    act(player, steps());
  });
}
