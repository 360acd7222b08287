"use strict";
const picture = JSON.parse(document.getElementById("picture").textContent);
const { width, height } = picture;
const count = width * height;
const byId = (id) => document.getElementById(id);
const stage = byId("stage"), view = byId("view"), exposure = byId("exposure");
const state = { layer: 0, channel: null, zoom: 1, x: 0, y: 0, fitted: true, held: null, hover: null };
const shown = new OffscreenCanvas(width, height);
// Large pictures are drawn of every so many pixels first, so that the exposure follows the hand.
const DRAFT_STEP = Math.ceil(Math.sqrt(count / 1e6)), DRAFT_MILLISECONDS = 200;

// --- values ---------------------------------------------------------------------------------

const BYTES = { half: 2, float: 4, uint: 4 };

/** The planes of a layer, one typed array each: base64, inflate, put bytes together again. */
async function unpack(layer) {
  const packed = Uint8Array.from(atob(layer.data), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const apart = new Uint8Array(await new Response(stream).arrayBuffer());
  const size = BYTES[layer.type], numbers = apart.length / size;
  const together = new Uint8Array(apart.length);
  for (let b = 0; b < size; ++b)
    for (let i = 0, from = b * numbers; i < numbers; ++i) together[i * size + b] = apart[from + i];
  delete layer.data;
  let all;
  if (layer.type === "half") {
    const bits = new Uint16Array(together.buffer);
    all = new Float32Array(numbers);
    for (let i = 0; i < numbers; ++i) all[i] = HALVES[bits[i]];
  } else {
    all = layer.type === "uint" ? new Uint32Array(together.buffer) : new Float32Array(together.buffer);
  }
  layer.planes = layer.channels.map((_, c) => all.subarray(c * count, (c + 1) * count));
}

const HALVES = Float32Array.from({ length: 65536 }, (_, bits) => {
  const sign = bits & 0x8000 ? -1 : 1, exponent = (bits >> 10) & 31, fraction = bits & 1023;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
});

/** What nearly all finite values are between, and 0 and 1 where they are all the same. */
function range(plane) {
  const some = [];
  for (let i = 0, step = Math.ceil(count / 65536); i < count; i += step)
    if (Number.isFinite(plane[i])) some.push(plane[i]);
  some.sort((a, b) => a - b);
  const low = some[Math.floor(0.002 * some.length)], high = some[Math.ceil(0.998 * some.length) - 1];
  return low < high ? [low, high] : [Math.min(low, 0) || 0, Math.max(high, 1) || 1];
}

// --- colours --------------------------------------------------------------------------------

/** IEC 61966-2-1 in 65536 steps. */
const SRGB = Uint8Array.from({ length: 65536 }, (_, i) => {
  const v = i / 65535;
  return Math.round(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055));
});
const encode = (v) => SRGB[v > 0 ? (v < 1 ? (v * 65535 + 0.5) | 0 : 65535) : 0];
const byte = (v) => (v > 0 ? (v < 1 ? (v * 255 + 0.5) | 0 : 255) : 0);
const STOPS = [[0, 0, 4], [87, 16, 110], [188, 55, 84], [249, 142, 9], [252, 255, 164]];
const RAMP = Array.from({ length: 256 }, (_, i) => {
  const at = (i / 255) * 4, k = Math.min(at | 0, 3), t = at - k;
  return STOPS[k].map((v, c) => Math.round(v + t * (STOPS[k + 1][c] - v)));
});

/** Some colour for a number: the bits mixed as by MurmurHash3's end. */
function idColor(n) {
  let h = n >>> 0;
  h = Math.imul(h ^ (h >>> 16), 0x85ebca6b);
  h = Math.imul(h ^ (h >>> 13), 0xc2b2ae35);
  h ^= h >>> 16;
  return n ? [64 + (h & 127), 64 + ((h >>> 8) & 127), 64 + ((h >>> 16) & 127)] : [24, 24, 24];
}

/** The numbers that Cryptomatte keeps in floats. */
const bitsOf = (plane) => new Uint32Array(plane.buffer, plane.byteOffset, count);

/** A function from a pixel's index and 2^exposure to three bytes in `out`. */
function shader(layer, channel) {
  const planes = layer.planes, m = picture.toRec709;
  const ramp = (plane, low, high) => (i, gain, out) => {
    const v = ((plane[i] - low) / (high - low)) * gain;
    const c = RAMP[byte(v)];
    out[0] = c[0]; out[1] = c[1]; out[2] = c[2];
  };
  if (layer.kind === "color") {
    const [r, g, b] = planes;
    if (channel === "L")
      return (i, gain, out) => {
        const y = 0.2126 * r[i] + 0.7152 * g[i] + 0.0722 * b[i];
        out[0] = out[1] = out[2] = encode(y * gain);
      };
    if (channel !== null) {
      const plane = planes[channel];
      return (i, gain, out) => { out[0] = out[1] = out[2] = encode(plane[i] * gain); };
    }
    return (i, gain, out) => {
      for (let c = 0; c < 3; ++c)
        out[c] = encode((m[c][0] * r[i] + m[c][1] * g[i] + m[c][2] * b[i]) * gain);
    };
  }
  if (layer.kind === "id")
    return (i, gain, out) => { const c = idColor(planes[0][i]); out[0] = c[0]; out[1] = c[1]; out[2] = c[2]; };
  if (layer.kind === "rgba") {
    // Cryptomatte: the number of the foremost thing is the bits of the first, its share the second.
    const bits = bitsOf(planes[0]), share = planes[1];
    return (i, gain, out) => {
      const c = idColor(bits[i]);
      for (let k = 0; k < 3; ++k) out[k] = c[k] * Math.min(Math.max(share[i], 0), 1);
    };
  }
  const chosen = planes.length === 1 ? 0 : channel;
  if (chosen !== null && chosen !== "L") {
    const [low, high] = layer.name === "alpha" ? [0, 1] : layer.ranges[chosen];
    if (layer.name === "alpha")
      return (i, gain, out) => { out[0] = out[1] = out[2] = byte(planes[0][i] * gain); };
    return ramp(planes[chosen], low, high);
  }
  // Directions about grey; places and coordinates from their least to their greatest.
  const unit = layer.ranges.every(([low, high]) => low >= -1.001 && high <= 1.001);
  const signed = unit && layer.ranges.some(([low]) => low < 0);
  const ranges = layer.ranges.map((r) => (signed ? [-1, 1] : r));
  return (i, gain, out) => {
    for (let c = 0; c < 3; ++c) {
      const plane = planes[c];
      out[c] = plane ? byte(((plane[i] - ranges[c][0]) / (ranges[c][1] - ranges[c][0])) * gain) : 0;
    }
  };
}

/** The layer's pixels, every `step`-th, as an ImageData. */
function shade(layer, channel, gain, step = 1) {
  const w = Math.ceil(width / step), h = Math.ceil(height / step);
  const image = new ImageData(w, h), data = image.data, paint = shader(layer, channel), out = [0, 0, 0];
  for (let y = 0, to = 0; y < h; ++y)
    for (let x = 0; x < w; ++x, to += 4) {
      paint(y * step * width + x * step, gain, out);
      data[to] = out[0]; data[to + 1] = out[1]; data[to + 2] = out[2]; data[to + 3] = 255;
    }
  return image;
}

// --- drawing --------------------------------------------------------------------------------

const layer = () => picture.layers[state.layer];
const gain = () => 2 ** Number(exposure.value);
let pending = false, stale = true, finishing = 0;

function shadeAll(step) {
  const pixels = shade(layer(), state.channel, gain(), step);
  shown.width = pixels.width;
  shown.height = pixels.height;
  shown.getContext("2d").putImageData(pixels, 0, 0);
}

function redraw(pixels = false) {
  stale ||= pixels;
  if (pending) return;
  pending = true;
  requestAnimationFrame(() => {
    pending = false;
    if (stale) {
      shadeAll(DRAFT_STEP);
      clearTimeout(finishing);
      if (DRAFT_STEP > 1) finishing = setTimeout(() => { shadeAll(1); draw(); }, DRAFT_MILLISECONDS);
    }
    stale = false;
    draw();
  });
}

function draw() {
  const ratio = devicePixelRatio, { clientWidth: w, clientHeight: h } = stage;
  if (view.width !== Math.round(w * ratio)) view.width = Math.round(w * ratio);
  if (view.height !== Math.round(h * ratio)) view.height = Math.round(h * ratio);
  const c = view.getContext("2d");
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  c.clearRect(0, 0, w, h);
  c.imageSmoothingEnabled = state.zoom < 1;
  c.imageSmoothingQuality = "high";
  c.drawImage(shown, state.x, state.y, width * state.zoom, height * state.zoom);
  if (state.zoom >= 72) drawNumbers(c, w, h);
  const marked = state.held;
  if (marked) {
    const size = Math.max(state.zoom, 5), middle = (size - state.zoom) / 2;
    c.strokeStyle = "#e8a33d";
    c.lineWidth = 1.5;
    c.strokeRect(state.x + marked.x * state.zoom - middle, state.y + marked.y * state.zoom - middle, size, size);
  }
  byId("zoom-value").value = `${Math.round(state.zoom * 100)} %`;
}

/** The values in the pixels themselves, where these are large enough. */
function drawNumbers(c, w, h) {
  const planes = layer().planes, z = state.zoom;
  c.font = "11px ui-monospace, 'DejaVu Sans Mono', monospace";
  c.textAlign = "center";
  const left = Math.max(Math.floor(-state.x / z), 0), right = Math.min(Math.ceil((w - state.x) / z), width);
  const top = Math.max(Math.floor(-state.y / z), 0), bottom = Math.min(Math.ceil((h - state.y) / z), height);
  for (let y = top; y < bottom; ++y)
    for (let x = left; x < right; ++x) {
      c.strokeStyle = "#0003";
      c.lineWidth = 1;
      c.strokeRect(state.x + x * z, state.y + y * z, z, z);
      c.lineWidth = 3;
      planes.forEach((plane, k) => {
        const text = brief(plane[y * width + x]);
        const at = [state.x + (x + 0.5) * z, state.y + (y + 0.5) * z + (k - (planes.length - 2) / 2) * 14 - 3];
        c.strokeStyle = "#000a";
        c.strokeText(text, ...at);
        c.fillStyle = "#fff";
        c.fillText(text, ...at);
      });
    }
}

const brief = (v) => (Number.isSafeInteger(v) ? String(v) : Number(v.toPrecision(4)).toString());
const full = (v) => (Number.isSafeInteger(v) ? String(v) : Number(v.toPrecision(7)).toString());

// --- what is told of a pixel ----------------------------------------------------------------

function tell() {
  const at = state.held ?? state.hover, l = layer();
  byId("swatch").classList.toggle("held", state.held !== null);
  if (!at) {
    byId("position").textContent = "";
    byId("values").replaceChildren();
    byId("name").textContent = "";
    byId("swatch").style.background = "none";
    return;
  }
  const i = at.y * width + at.x, out = [0, 0, 0];
  byId("position").textContent = `x ${at.x}  y ${at.y}`;
  byId("values").replaceChildren(
    ...l.planes.flatMap((plane, c) => {
      const name = document.createElement("i"), value = document.createElement("span");
      name.textContent = `${c ? "  " : ""}${l.channels[c]} `;
      value.textContent = full(plane[i]);
      value.dataset.channel = l.channels[c];
      return [name, value];
    }),
  );
  const named = l.names[l.kind === "rgba" ? bitsOf(l.planes[0])[i] : l.planes[0][i]];
  byId("name").textContent = ["id", "rgba"].includes(l.kind) && named ? named : "";
  shader(l, state.channel)(i, gain(), out);
  byId("swatch").style.background = `rgb(${out.map(Math.round).join(" ")})`;
}

function pixelAt(event) {
  const box = stage.getBoundingClientRect();
  const x = Math.floor((event.clientX - box.left - state.x) / state.zoom);
  const y = Math.floor((event.clientY - box.top - state.y) / state.zoom);
  return x >= 0 && y >= 0 && x < width && y < height ? { x, y } : null;
}

// --- what the user does ---------------------------------------------------------------------

function chooseLayer(number) {
  state.layer = Math.min(Math.max(number, 0), picture.layers.length - 1);
  state.channel = null;
  document.querySelectorAll(".layer").forEach((button, k) => {
    button.setAttribute("aria-selected", k === state.layer);
    if (k === state.layer) button.scrollIntoView({ block: "nearest" });
  });
  const l = layer(), several = l.planes.length > 1 && l.kind !== "rgba";
  const names = several ? [...l.channels, ...(l.kind === "color" ? ["L"] : [])] : [];
  byId("channel-buttons").replaceChildren(
    ...names.map((name, c) => {
      const button = document.createElement("button");
      button.textContent = name;
      button.title = name === "L" ? "luminance" : `channel ${name}`;
      button.addEventListener("click", () => chooseChannel(name === "L" ? "L" : c));
      return button;
    }),
  );
  chooseChannel(null);
}

function chooseChannel(channel) {
  state.channel = state.channel === channel ? null : channel;
  document.querySelectorAll("#channel-buttons button").forEach((button, c) => {
    button.setAttribute("aria-pressed", state.channel === (button.textContent === "L" ? "L" : c));
  });
  const l = layer(), chosen = l.planes.length === 1 ? 0 : state.channel;
  const legend = typeof chosen === "number" && !["color", "id", "rgba"].includes(l.kind) && l.name !== "alpha";
  byId("legend").hidden = !legend;
  if (legend) {
    const [low, high] = l.ranges[chosen];
    byId("low").textContent = brief(low);
    byId("high").textContent = brief(low + (high - low) / gain());
  }
  redraw(true);
  tell();
}

function setExposure(value) {
  exposure.value = value;
  exposure.dispatchEvent(new Event("input"));
}

/** Zoom about a place of the window; without one the pixel that is held, or the middle. */
function zoomTo(zoom, x, y) {
  const { held } = state;
  x ??= held ? state.x + (held.x + 0.5) * state.zoom : stage.clientWidth / 2;
  y ??= held ? state.y + (held.y + 0.5) * state.zoom : stage.clientHeight / 2;
  const next = Math.min(Math.max(zoom, 0.02), 256);
  state.fitted = false;
  state.x = x - ((x - state.x) * next) / state.zoom;
  state.y = y - ((y - state.y) * next) / state.zoom;
  state.zoom = next;
  redraw();
}

function centre(zoom) {
  state.fitted = false;
  state.zoom = zoom;
  state.x = Math.round((stage.clientWidth - width * zoom) / 2);
  state.y = Math.round((stage.clientHeight - height * zoom) / 2);
  redraw();
}

function fit() {
  const zoom = Math.min((stage.clientWidth - 24) / width, (stage.clientHeight - 24) / height);
  centre(zoom >= 1 ? Math.min(Math.floor(zoom), 8) : zoom);
  state.fitted = true;
}

function listen() {
  exposure.addEventListener("input", () => {
    byId("exposure-value").value = `${exposure.value > 0 ? "+" : ""}${Number(exposure.value).toFixed(1)}`;
    const chosen = state.channel;
    state.channel = undefined;
    chooseChannel(chosen);
  });
  byId("exposure-value").addEventListener("dblclick", () => setExposure(0));
  byId("zoom-in").addEventListener("click", () => zoomTo(state.zoom * 2));
  byId("zoom-out").addEventListener("click", () => zoomTo(state.zoom / 2));
  byId("fit").addEventListener("click", fit);
  byId("actual").addEventListener("click", () => centre(1));
  byId("about-button").addEventListener("click", toggleAbout);
  stage.addEventListener("wheel", (event) => {
    event.preventDefault();
    const box = stage.getBoundingClientRect();
    zoomTo(state.zoom * 2 ** (-event.deltaY / 240), event.clientX - box.left, event.clientY - box.top);
  }, { passive: false });
  let from = null;
  stage.addEventListener("pointerdown", (event) => {
    stage.setPointerCapture(event.pointerId);
    from = { x: event.clientX - state.x, y: event.clientY - state.y, moved: false, at: [event.clientX, event.clientY] };
  });
  stage.addEventListener("pointermove", (event) => {
    if (from && Math.hypot(event.clientX - from.at[0], event.clientY - from.at[1]) > 3) from.moved = true;
    if (from?.moved) {
      stage.classList.add("moving");
      state.fitted = false;
      state.x = event.clientX - from.x;
      state.y = event.clientY - from.y;
      redraw();
    }
    state.hover = pixelAt(event);
    tell();
  });
  stage.addEventListener("pointerup", (event) => {
    const at = pixelAt(event);
    if (from && !from.moved)
      state.held = at && state.held && at.x === state.held.x && at.y === state.held.y ? null : at;
    from = null;
    stage.classList.remove("moving");
    redraw();
    tell();
  });
  stage.addEventListener("pointerleave", () => { state.hover = null; tell(); });
  new ResizeObserver(() => (state.fitted ? fit() : redraw())).observe(stage);
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const key = event.key, onSlider = event.target === exposure;
    const channel = layer().channels.indexOf(key.toUpperCase());
    if (key === "ArrowUp") chooseLayer(state.layer - 1);
    else if (key === "ArrowDown") chooseLayer(state.layer + 1);
    else if (key === "ArrowLeft" && !onSlider) setExposure(Number(exposure.value) - 0.5);
    else if (key === "ArrowRight" && !onSlider) setExposure(Number(exposure.value) + 0.5);
    else if (key === "0") setExposure(0);
    else if (key === "+" || key === "=") zoomTo(state.zoom * 2);
    else if (key === "-") zoomTo(state.zoom / 2);
    else if (key === "1") centre(1);
    else if (key === "f" || key === "F") fit();
    else if (key === "i" || key === "I") toggleAbout();
    else if (/^[lL]$/.test(key) && layer().kind === "color") chooseChannel("L");
    else if (channel >= 0 && layer().planes.length > 1 && layer().kind !== "rgba") chooseChannel(channel);
    else return;
    event.preventDefault();
  });
}

function toggleAbout() {
  byId("about").hidden = !byId("about").hidden;
  byId("about-button").setAttribute("aria-expanded", !byId("about").hidden);
}

function list() {
  for (const [number, l] of picture.layers.entries()) {
    const button = document.createElement("button"), canvas = document.createElement("canvas");
    const step = Math.max(Math.ceil(width / 156), 1), thumbnail = shade(l, null, 1, step);
    canvas.width = thumbnail.width;
    canvas.height = thumbnail.height;
    canvas.getContext("2d").putImageData(thumbnail, 0, 0);
    const line = document.createElement("span"), name = document.createElement("b"), what = document.createElement("small");
    name.textContent = l.name;
    what.textContent = `${l.channels.length > 1 ? l.channels.join("") + " " : ""}${l.type}`;
    line.append(name, what);
    button.append(canvas, line);
    button.className = "layer";
    button.title = l.name;
    button.setAttribute("role", "option");
    button.addEventListener("click", () => chooseLayer(number));
    byId("layers").append(button);
  }
  const about = byId("about").querySelector("dl");
  for (const [name, value] of Object.entries({ "colour space": picture.colorSpace, ...picture.about })) {
    const dt = document.createElement("dt"), dd = document.createElement("dd");
    dt.textContent = name.replaceAll("_", " ");
    dd.textContent = value;
    about.append(dt, dd);
  }
  byId("size").textContent = `${width} × ${height}  ${picture.colorSpace}`;
  const ramp = new ImageData(128, 1);
  for (let x = 0; x < 128; ++x) ramp.data.set([...RAMP[2 * x], 255], 4 * x);
  byId("ramp").getContext("2d").putImageData(ramp, 0, 0);
}

(async () => {
  await Promise.all(picture.layers.map(unpack));
  for (const l of picture.layers) l.ranges = l.planes.map(range);
  list();
  listen();
  byId("loading").remove();
  fit();
  chooseLayer(0);
  document.body.dataset.ready = "true";
})();
