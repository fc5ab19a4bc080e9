#!/usr/bin/env bash
# Kills renders and trainings at random moments with SIGKILL, and checks that every restart works, that no file is ever
# half-written, and that what comes out in the end is what an uninterrupted run makes, byte for byte.
#
#     cargo build --release && tests/kill.sh target/release/opsr 100
#
# Not part of the automatic tests: it takes minutes.
set -eu
program=$(realpath "$1")
times=${2:-100}
cd "$(dirname "$0")/.."
root=$PWD
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() {
    echo "FAILED: $*" >&2
    exit 1
}

# A render and a training of a few seconds; -u: the same to the byte whatever was in between.
render() {
    "$program" render "$root/training_scenes/cornell_caustics.glb" --size 96x96 --spp 512 --seed 7 --reproducible \
        --checkpoint "$1/render.ckpt" --save-every 200ms -o "$1/render.exr" --progress none "${@:2}"
}
train() {
    "$program" train --preset smoke --set 'manifest="'"$root"'/training_scenes/manifest.toml"' --spp 16 --steps 60 \
        --set checkpoint_every=2 --set validate_every=20 --run "$1/run" --out "$1/params" --progress none "${@:2}"
}

# True if the killed command left anything to go on from.
resumable() {
    [ -e "$work/killed/$checkpoint" ] || compgen -G "$work/killed/run/recordings/*.recording" >/dev/null
}

# check COMMAND: kills COMMAND at random moments until it has been killed $times times, each time going on.
check() {
    command=$1 file=$2 checkpoint=$3
    mkdir -p "$work/whole" "$work/killed"
    start=$(date +%s%N)
    "$command" "$work/whole"
    took=$((($(date +%s%N) - start) / 1000000))
    killed=0 rounds=0
    while [ "$killed" -lt "$times" ]; do
        rounds=$((rounds + 1))
        resume=()
        resumable && resume=(--resume)
        "$command" "$work/killed" "${resume[@]}" 2>"$work/errors" &
        pid=$!
        sleep "$(awk -v r=$RANDOM -v ms="$took" 'BEGIN { print 0.02 + ms / 1000 * r / 32768 }')"
        if kill -9 "$(pgrep -P "$pid" -f "$program" || echo "$pid")" 2>/dev/null; then
            killed=$((killed + 1))
        fi
        status=0
        wait "$pid" 2>/dev/null || status=$?
        [ "$status" -eq 0 ] || [ "$status" -eq 137 ] || {
            cat "$work/errors" >&2
            fail "$command: status $status after $killed kills"
        }
        # A finished one starts anew.
        if [ "$status" -eq 0 ]; then
            cmp "$work/whole/$file" "$work/killed/$file" || fail "$command: another result after kills"
            rm -rf "$work/killed"
            mkdir -p "$work/killed"
        fi
    done
    resume=()
    resumable && resume=(--resume)
    "$command" "$work/killed" "${resume[@]}"
    cmp "$work/whole/$file" "$work/killed/$file" || fail "$command: another result after kills"
    rm -rf "$work/whole" "$work/killed"
    echo "$command: killed $killed times in $rounds runs, every restart worked, the result is the same to the byte"
}

check render render.exr render.ckpt
check train params/smoke-beta-0.001.json run/smoke-beta-0.001/last.ckpt
