// GLB files taken apart and put together, to break them on purpose.

import { readFileSync } from "node:fs";

/** JSON and binary chunk of a GLB. */
export function readGlb(file) {
  const bytes = readFileSync(file);
  const length = bytes.readUInt32LE(12);
  return { json: JSON.parse(bytes.toString("utf8", 20, 20 + length)), bin: bytes.subarray(20 + length + 8) };
}

/** The file again, as an ArrayBuffer. */
export function toGlb({ json, bin }) {
  const text = Buffer.from(JSON.stringify(json));
  const padded = Buffer.concat([text, Buffer.alloc(-text.length & 3, " ")]);
  const chunk = (type, bytes) => {
    const head = Buffer.alloc(8);
    head.writeUInt32LE(bytes.length, 0);
    head.write(type, 4, "latin1");
    return Buffer.concat([head, bytes]);
  };
  const body = Buffer.concat([chunk("JSON", padded), chunk("BIN\0", bin)]);
  const head = Buffer.alloc(12);
  head.write("glTF");
  head.writeUInt32LE(2, 4);
  head.writeUInt32LE(12 + body.length, 8);
  return new Uint8Array(Buffer.concat([head, body])).buffer;
}
