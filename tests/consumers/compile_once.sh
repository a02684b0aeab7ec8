#!/usr/bin/env bash
# A launcher for compilers: what another consumer compiled already, the same text behind all
# includes, with the same flags, is not compiled again, but copied. The folder $COMPILED has it.
#   compile_once.sh COMPILER ARGUMENTS...
set -euo pipefail

preprocess=() flags=() output="" compiles=no
words=("$@")
for ((i = 0; i < ${#words[@]}; ++i)); do
  word="${words[i]}"
  case "$word" in
    -c) compiles=yes ;;
    -o) output="${words[++i]}" && continue ;;
    # What only says where things are, or is seen in the text.
    -MF | -MT | -MQ | -isystem | -include) preprocess+=("$word") && word="${words[++i]}" ;;
    -I* | -D* | -M* | *.cpp) ;;
    *) flags+=("$word") ;;
  esac
  preprocess+=("$word")
done
[ "$compiles" = yes ] || exec "$@"

text="$(mktemp "$COMPILED/text.XXXXXX")"
"${preprocess[@]}" -E -P -o "$text"
object="$COMPILED/$( (echo "${flags[*]}" && cat "$text") | cksum | tr ' ' _)"
rm "$text"
until mkdir "$object.lock" 2> /dev/null; do sleep 0.2; done  # another one compiles it
trap 'rmdir "$object.lock"' EXIT
[ -e "$object.o" ] || "$@"
[ -e "$object.o" ] || cp "$output" "$object.o"
cp "$object.o" "$output"
