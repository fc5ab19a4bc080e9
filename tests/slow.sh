#!/usr/bin/env bash
# Every check that takes too long for each change: hours, one of them for the memory alone. `opsr verify` has others.
#
#     tests/slow.sh
#
# Fuzzing takes OPSR_FUZZ_EXECUTIONS inputs of each kind (100000 if not set), the watch over the memory
# OPSR_LONG_SECONDS (3600). Needs valgrind and python3.
set -u
cd "$(dirname "$0")/.."
failed=0
step() {
    name=$1
    shift
    echo "== $name"
    if "$@"; then
        echo "ok: $name"
    else
        echo "FAILED: $name"
        failed=1
    fi
}
# As the tests do, so that nothing is built twice.
step "build" cargo test --release --no-run
program=target/release/opsr
step "instructions of what is not used" tests/instructions.sh "$program"
step "killed at random moments" tests/kill.sh "$program" 200
export OPSR_FUZZ_EXECUTIONS=${OPSR_FUZZ_EXECUTIONS:-100000}
step "chi-square, furnaces and invariants" "$program" verify --thorough
step "renders against the simple path tracer" "$program" verify render --thorough
step "planted faults of renders" "$program" verify render --plant all
# Two cores: five minutes of CPU time.
step "chaos" "$program" verify chaos --time 150s --seed "${OPSR_CHAOS_SEED:-1000000}"
step "fuzzing" cargo test --release fuzz_long -- --ignored
step "slopes of errors" cargo test --release slopes_long -- --ignored
step "faults planted in the source" tests/planted.sh
step "memory" tests/long.sh "$program" "${OPSR_LONG_SECONDS:-3600}"
[ "$failed" -eq 0 ] && echo "all slow checks passed"
exit "$failed"
