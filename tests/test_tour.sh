#!/bin/bash
# Looks at examples/tour.md: what it shows is in the programs, what it names is in the header, and
# the programs hold what it says.
#   test_tour.sh TOUR
set -u
tour=$1
root=$(cd "$(dirname "$0")/.." && pwd)
text=$root/examples/tour.md
temporary=$(mktemp -d)
trap 'rm -rf "$temporary"' EXIT
failures=0
fail() { echo "tour.md: $*"; failures=$((failures + 1)); }

# The lines of a part of the header, from its banner to the next one.
part() {
  awk -v banner="// ==== [$1] " 'index($0, "// ==== [") == 1 { inside = index($0, banner) == 1 }
                                 inside' "$root/ism.hpp"
}

# A block of code must be in a file to the letter, as it is or inside of a function.
check_code() {  # step, code
  local file=$root/examples/tour/step_$1.cpp content indented
  content=$(cat "$file")
  indented=$(sed 's/^\(.\)/  \1/' <<< "$2")
  [[ $'\n'$content$'\n' == *$'\n'"$2"$'\n'* || $'\n'$content$'\n' == *$'\n'"$indented"$'\n'* ]] ||
    fail "step $1: this is not in $file:"$'\n'"$2"
}

# "[7] `compute_overlay`, `OverlayPolygon`; [15] ...": names are defined in the part before them.
check_names() {  # step, line
  local word number=0 count=0
  for word in $(grep -oE '\[[0-9]+\]|`[A-Za-z0-9_:]+`' <<< "$2"); do
    if [[ $word == \[* ]]; then
      number=${word//[^0-9]/}
      part "$number" > "$temporary/part"
      continue
    fi
    word=${word//\`/}
    word=${word##*::}
    count=$((count + 1))
    grep -qE "(class|struct|enum class) ([a-z0-9()]+ )*$word\b|\b$word(\(| =|;| \{)" "$temporary/part" ||
      fail "step $1: part [$number] of ism.hpp has no $word"
  done
  [ "$count" -gt 0 ] || fail "step $1 names nothing"
}

# ---- step by step ----

step=00 code='' in_code=false in_names=false
declare -A blocks names pictures
while IFS= read -r line; do
  if [[ $line =~ ^'## '([0-9]+)'. ' ]]; then
    step=$(printf '%02d' "${BASH_REMATCH[1]}")
  elif [[ $line == '```cpp' ]]; then
    in_code=true code=''
  elif [[ $line == '```' && $in_code == true ]]; then
    in_code=false
    blocks[$step]=1
    check_code "$step" "${code%$'\n'}"
  elif [[ $in_code == true ]]; then
    code+=$line$'\n'
  elif [[ $line == '*In `ism.hpp`:*'* ]]; then
    names[$step]=${line#*:\*}
    in_names=true
  elif [[ -z $line ]]; then
    in_names=false
  elif [[ $in_names == true ]]; then
    names[$step]+=" $line"
  elif [[ $line == '![Step '*"](tour/step_$step.png)" ]]; then
    pictures[$step]=1
  fi
done < "$text"
for step in 01 02 03 04 05 06 07 08 09 10; do
  [ -n "${blocks[$step]-}" ] || fail "step $step shows no code"
  check_names "$step" "${names[$step]-}"
  [ -n "${pictures[$step]-}" ] || fail "step $step has no picture"
done

# ---- what is said ----

size() { od -An -t x1 -j 16 -N 8 "$1"; }  # of a PNG file
"$tour" -o "$temporary" || fail "what is said does not hold"
for step in 01 02 03 04 05 06 07 08 09 10; do
  picture=step_$step.png
  [ -s "$temporary/$picture" ] || { fail "the program does not draw $picture"; continue; }
  [ "$(size "$temporary/$picture")" = "$(size "$root/examples/tour/$picture")" ] ||
    fail "$picture has another size than the program draws"
done

[ "$failures" -eq 0 ] && echo "the tour is as it says"
exit $((failures > 0))
