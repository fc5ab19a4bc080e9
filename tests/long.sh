#!/usr/bin/env bash
# Renders and trains for an hour each, side by side on one thread each, and checks that memory grows by at most 1 %: the
# least of the last sixth of the time against that of the second sixth (the first loads and records, and the allocator
# settles in the first few hundred saves of a picture; each takes memory for a moment).
#
#     cargo build --release && tests/long.sh target/release/opsr 3600
#
# Not part of the automatic tests.
set -eu
program=$(realpath "$1")
seconds=${2:-3600}
cd "$(dirname "$0")/.."
work=$(mktemp -d)
trap 'kill $(jobs -p) 2>/dev/null; rm -rf "$work"' EXIT

# watch NAME COMMAND...: runs a command for the time, writes its resident memory down, then stops it as Ctrl-C does.
watch() {
    name=$1
    shift
    "$@" >"$work/$name.out" 2>&1 &
    pid=$!
    end=$((SECONDS + seconds))
    while [ "$SECONDS" -lt "$end" ] && kill -0 "$pid" 2>/dev/null; do
        awk '/^VmRSS/ { print $2 }' "/proc/$pid/status" >>"$work/$name" || true
        sleep "$(awk -v s="$seconds" 'BEGIN { print s / 720 }')"
    done
    kill -INT "$pid" 2>/dev/null || true
    status=0
    wait "$pid" || status=$?
    if [ "$status" -ne 5 ]; then
        cat "$work/$name.out" >&2
        echo "FAILED: $name: exit code $status before the time was up" >&2
        return 1
    fi
    awk -v name="$name" -v seconds="$seconds" '
        function least(from, to,    i, m) {
            m = rss[to]
            for (i = from; i < to; i++) if (rss[i] < m) m = rss[i]
            return m
        }
        { rss[NR] = $1 }
        END {
            early = least(int(NR / 6) + 1, int(NR / 3)); late = least(int(NR * 5 / 6) + 1, NR)
            growth = 100 * (late - early) / early
            printf "%s: %d s, %.1f MiB, then %.1f MiB: %+.2f %%\n", name, seconds, early / 1024, late / 1024, growth
            exit growth > 1
        }' "$work/$name"
}

watch render "$program" render training_scenes/cornell_caustics.glb --opsr-table params/beta-0.001.json --spp 100000000 \
    --threads 1 --checkpoint "$work/render.ckpt" --save-every 1s -o "$work/render.exr" --progress none &
render=$!
watch train "$program" train --spp 64 --steps 100000000 --run "$work/run" --out "$work/params" --threads 1 \
    --set checkpoint_every=100 --progress none &
train=$!
failed=0
wait "$render" || failed=1
wait "$train" || failed=1
exit "$failed"
