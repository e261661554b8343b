// What the C of an FMU calls of its library, in JavaScript: mathematics is the browser's, as it is the machine's elsewhere.

const PAGE = 65536; // bytes by which memory grows
const NUMBERS = ["sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "exp", "expm1", "log", "log1p"];
const FORMAT = /%(0\d+)?(\.\*)?(ll)?([cdesx])/g;

// Where JavaScript has no number, C has one (C99, annex F.9.4.4).
function pow(base, exponent) {
  const one = base === 1 || (base === -1 && Math.abs(exponent) === Infinity);
  return one ? 1 : base ** exponent;
}

// The functions by name; `memory()` is asked when they are called, and `say` takes the bytes for standard error.
export function libc(memory, say) {
  let end = 0; // of what has been given out

  // Nothing is given back: a page makes one instance of a model, and a sentence takes little.
  function malloc(size) {
    const have = memory().buffer.byteLength;
    const place = end || have;
    const lacking = place + size - have;
    try {
      if (lacking > 0) memory().grow(Math.ceil(lacking / PAGE));
    } catch {
      return 0;
    }
    end = place + 16 * Math.ceil(size / 16);
    return place;
  }

  const bytes = (place, length) => new Uint8Array(memory().buffer, place, length);
  const strlen = (place) => bytes(place).indexOf(0);
  const text = (place) => String.fromCharCode(...bytes(place, strlen(place))); // a character is a byte
  function strchr(place, character) {
    const found = text(place).indexOf(String.fromCharCode(character));
    return found < 0 ? 0 : place + found;
  }
  function strcmp(one, other) {
    const [a, b] = [text(one), text(other)];
    return a < b ? -1 : Number(a > b);
  }

  // What the sentences need of it; `values` is where the compiler has put all that follows the format.
  function snprintf(place, room, format, values) {
    const view = new DataView(memory().buffer);
    function next(size) {
      values = size * Math.ceil(values / size) + size;
      return values - size;
    }
    function written(_, width = "", precision, long, kind) {
      const most = precision && view.getInt32(next(4), true);
      if (kind === "e") {
        const [digits, power] = view.getFloat64(next(8), true).toExponential(most).split("e");
        return `${digits}e${power[0]}${power.slice(1).padStart(2, "0")}`;
      }
      const value = long ? view.getBigInt64(next(8), true) : view.getInt32(next(4), true);
      if (kind === "s") return text(value).slice(0, most);
      if (kind === "c") return String.fromCharCode(value);
      return value.toString(kind === "x" ? 16 : 10).padStart(Number(width), "0");
    }
    const all = text(format).replace(FORMAT, written);
    const kept = bytes(place, Math.min(all.length + 1, room));
    kept.forEach((_, i) => (kept[i] = i < kept.length - 1 ? all.charCodeAt(i) : 0));
    return all.length;
  }

  return {
    ...Object.fromEntries(NUMBERS.map((name) => [name, Math[name]])),
    ...{ pow, fmod: (a, b) => a % b },
    ...{ malloc, calloc: (count, size) => malloc(count * size), free: () => {} }, // memory that grows is zero
    ...{ strlen, strchr, strcmp, snprintf, strtod: (place) => Number(text(place)), atoi: (place) => parseInt(text(place)) },
    fwrite: (place, size, count) => say(bytes(place, size * count)),
  };
}
