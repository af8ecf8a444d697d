// A server for the viewer, for work and for tests.
//
//   node tools/viewer/serve.mjs [FOLDER]     serves FOLDER's scenes as /scenes/, and prints where to look

import { createServer } from "node:http";
import { readFile, readdir } from "node:fs/promises";
import { dirname, extname, join, normalize, sep } from "node:path";
import { fileURLToPath } from "node:url";

const TOOLS = dirname(dirname(fileURLToPath(import.meta.url)));
const TYPES = {
  ".html": "text/html; charset=utf-8", ".js": "text/javascript", ".json": "application/json", ".png": "image/png",
  ".glb": "model/gltf-binary", ".gltf": "model/gltf+json", ".exr": "image/x-exr",
};

/** Serves tools/ and, as /scenes/, `folder`; only to this machine. Port 0: any free one. */
export function serve(folder, port = 0) {
  const server = createServer(async (request, response) => {
    try {
      const path = normalize(decodeURIComponent(new URL(request.url, "http://localhost").pathname));
      const place = path.startsWith("/scenes/") ? join(folder, path.slice("/scenes".length)) : join(TOOLS, path);
      const file = place.endsWith(sep) ? join(place, "index.html") : place;
      const body = await readFile(file);
      response.writeHead(200, { "content-type": TYPES[extname(file)] ?? "application/octet-stream" }).end(body);
    } catch {
      response.writeHead(404).end();
    }
  });
  return new Promise((resolve) => {
    server.listen(port, "127.0.0.1", () => resolve({ server, url: `http://127.0.0.1:${server.address().port}` }));
  });
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  const folder = process.argv[2] ?? ".";
  const { url } = await serve(folder, 8137);
  console.log(`${url}/viewer/`);
  for (const name of (await readdir(folder)).filter((name) => /\.gl(b|tf)$/i.test(name))) {
    console.log(`${url}/viewer/?file=/scenes/${encodeURIComponent(name)}`);
  }
}
