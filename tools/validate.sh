#!/usr/bin/env bash
# Bakes the scenes of assets/ in several ways and holds every output against the Khronos glTF validator.
#
#   tools/validate.sh LUXEL FOLDER      LUXEL: the program; FOLDER: where outputs go
set -euo pipefail
luxel=$1
out=$2
here=$(cd "$(dirname "$0")" && pwd)
assets=$here/../assets

bake() { # IN OUT OPTION...
    local in=$1 result=$2
    shift 2
    echo "$(basename "$in") -> $(basename "$result") $*"
    "$luxel" bake "$in" -o "$result" --quiet --resolution 512 --rays 4 "$@" >/dev/null
    node "$here/validator.mjs" --compare "$in" "$result"
}

for scene in cornell room living_room garden_bridge; do
    bake "$assets/$scene.glb" "$out/$scene.lit.glb" --sky 1,1,1
done
bake "$assets/room.glb" "$out/room.sun.glb" --sun 150,35,8 --strip-lights --float
bake "$assets/room.glb" "$out/room.gltf" --sidecar
bake "$out/cornell.lit.glb" "$out/cornell.again.glb"
bake "$assets/cornell.glb" "$out/cornell.lit2.glb" --flat "$out/cornell.flat.glb"
node "$here/validator.mjs" "$out/cornell.flat.glb"
