// Names of series: which belong together, and what people call them.

const UNITS = [
  ["_deg_s", "°/s"],
  ["_deg", "°"],
  ["_m", "m"],
  ["_s", "s"],
];

/** Unit of a channel by the end of its name, and the name without it. */
export function unitOf(channel) {
  for (const [end, unit] of UNITS) {
    if (channel.endsWith(end)) return { unit, bare: channel.slice(0, -end.length) };
  }
  return { unit: "", bare: channel };
}

/**
 * Left and right of one angle as one pair; what has no side is a pair of one.
 * Each is `{name, title, unit, channels: [{channel, side}]}`.
 */
export function pairsOf(channels) {
  const pairs = new Map();
  for (const channel of channels) {
    const found = /^(left|right)_(.+)$/.exec(channel);
    const [side, name] = found ? [found[1], found[2]] : ["", channel];
    if (!pairs.has(name)) {
      const { unit, bare } = unitOf(name);
      const words = bare.replaceAll("_", " ");
      pairs.set(name, { name, title: words[0].toUpperCase() + words.slice(1), unit, channels: [] });
    }
    pairs.get(name).channels.push({ channel, side });
  }
  for (const pair of pairs.values()) pair.channels.sort((a, b) => a.side.localeCompare(b.side));
  return [...pairs.values()];
}
