#!/usr/bin/env bash
# The intrinsics and the walk through trees in Miri, which knows what is undefined behaviour. About a minute, and needs
#     rustup toolchain install nightly --component miri
# Tree borrows: the threads' crossbeam-epoch breaks the rules of stacked borrows, a matter of its own.
set -euo pipefail
cd "$(dirname "$0")/.."
export RUSTFLAGS="-Ctarget-feature=+avx2,+bmi1,+lzcnt"
export MIRIFLAGS="-Zmiri-tree-borrows -Zmiri-permissive-provenance -Zmiri-ignore-leaks"
cargo +nightly miri test --lib -- math::simd trace::stack trace::tests::places::triangles trace::tests::hits_close
