#!/usr/bin/env bash
# Holds the size of the source: lines of Rust of each crate, tests in files of their own left out, options of `opsr render` and keys of
# its `--set`, and public items of the library. `tests/budget.txt` has the most of each. A change that needs more raises the number there, and its commit
# says what it is for.
#
#     tests/budget.sh
set -eu
cd "$(dirname "$0")/.."
lines() { find "$1" -name '*.rs' ! -name tests.rs -exec cat {} + | wc -l; }
declared() { grep -cE "^    [a-z_]+: [A-Za-z0-9<>:]+, ($1) \{" src/render/spec.rs; }
count() {
    case $1 in
    # The declared ones, `--set`, and the fields of the program but the scene and two groups.
    options) echo $(($(declared 'Scene|Light|Camera|Stop|Method|Files') + 1 + $(grep -cE '^    pub\(super\) [a-z_]+:' crates/cli/src/render_args.rs) - 3)) ;;
    keys) declared Research ;;
    public) grep -rhE '^ *pub (const fn|unsafe fn|fn|struct|enum|trait|const|static|type|mod|use)\b' src | wc -l ;;
    *) lines "$1" ;;
    esac
}
failed=0
while read -r what most; do
    found=$(count "$what")
    echo "$what: $found, at most $most"
    [ "$found" -gt 0 ] && [ "$found" -le "$most" ] || { echo "$what: over the budget, or not there"; failed=1; }
done <tests/budget.txt
exit "$failed"
