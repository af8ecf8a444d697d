// The size of a page's picture, without decoding it: EXR of scanlines, as luxel writes them.

const MAGIC = 20000630;
/** Lines in a block, by compression: none, RLE, ZIPS, ZIP. */
const LINES = [1, 1, 1, 16];

/** Width and height; null if bytes are missing, or it is no such picture. */
export function sizeOf(bytes) {
  try {
    return wholeSize(bytes);
  } catch (error) {
    if (error instanceof RangeError) return null;
    throw error;
  }
}

/** Reading beyond the end is a RangeError of DataView. */
function wholeSize(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (view.getUint32(0, true) !== MAGIC) return null;
  let at = 8;
  const word = () => {
    let text = "";
    for (let code; (code = view.getUint8(at++)); ) text += String.fromCharCode(code);
    return text;
  };
  const attributes = {};
  for (let name; (name = word()); ) {
    word();
    attributes[name] = at + 4;
    at += 4 + view.getUint32(at, true);
  }
  const [left, top, right, bottom] = [0, 4, 8, 12].map((byte) => view.getInt32(attributes.dataWindow + byte, true));
  const lines = LINES[view.getUint8(attributes.compression)];
  if (!lines) return null;
  for (let line = top; line <= bottom; line += lines, at += 8) {
    const block = Number(view.getBigUint64(at, true));
    if (block + 8 + view.getUint32(block + 4, true) > bytes.byteLength) return null;
  }
  return [right - left + 1, bottom - top + 1];
}
