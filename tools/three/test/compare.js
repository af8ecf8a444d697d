// The viewer's pixels held against luxel's preview.
//
// A preview has two by two rays a pixel, at the very points that pixels of a picture of twice its size have; each is
// exposed and rolled off above .6, then four are averaged, then encoded. So the viewer's picture is taken at twice the
// size, without tone mapping, and sent the same way here. It is clipped at 1, which the roll-off makes CLIPPED: there,
// previews are compared no further.

const decode = (level) => {
  const c = level / 255;
  return c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4;
};
const encode = (c) => 255 * (c <= 0.0031308 ? c * 12.92 : 1.055 * c ** (1 / 2.4) - 0.055);
const rolledOff = (x) => (x <= 0.6 ? x : 1 - 0.4 * Math.exp((0.6 - x) / 0.4));
const LINEAR = Array.from({ length: 256 }, (_, level) => rolledOff(decode(level)));
const CLIPPED = Math.round(encode(rolledOff(1)));

/**
 * Differences in levels of eight bits over all pixels that are not black in both: median and 99th percentile of the
 * largest of three channels, and the mean with its sign.
 */
export function compare(viewer, preview) {
  const { width, height } = preview;
  if (viewer.width !== 2 * width || viewer.height !== 2 * height) throw new Error("the viewer's picture has the wrong size");
  const differences = [];
  let sum = 0;
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const corners = [0, 1, 2, 3].map((k) => 4 * ((2 * y + (k >> 1)) * viewer.width + 2 * x + (k & 1)));
      let [largest, seen] = [0, false];
      for (let channel = 0; channel < 3; channel++) {
        const mean = corners.reduce((total, at) => total + LINEAR[viewer.data[at + channel]], 0) / 4;
        const [shown, wanted] = [encode(mean), Math.min(preview.data[4 * (y * width + x) + channel], CLIPPED)];
        largest = Math.max(largest, Math.abs(shown - wanted));
        seen ||= shown > 0 || wanted > 0;
        sum += shown - wanted;
      }
      if (seen) differences.push(largest);
    }
  }
  differences.sort((a, b) => a - b);
  const at = (share) => differences[Math.floor(share * (differences.length - 1))];
  return { median: at(0.5), p99: at(0.99), largest: at(1), mean: sum / 3 / differences.length, pixels: differences.length };
}
