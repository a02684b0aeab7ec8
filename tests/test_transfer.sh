#!/usr/bin/env bash
# Characters from outside: test_transfer.sh <ism_transfer> <characters> [<ism_map>]
# What is carried between two limbs is compared with the truth, what was there must stay, and bad
# input must give exit code 2, one sentence and no file. Khronos' validator looks at the results if
# npm can install it, in a temporary folder, or VALIDATOR is a folder with node_modules that has it.
set -euo pipefail

ism_transfer="$1"
characters="$2"
ism_map="${3:-}"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

"$characters" make .

# ---- Results -------------------------------------------------------------------------------------

carry() {  # OUT ARGUMENT...
  local out="$1"
  shift
  "$ism_transfer" source.glb target.glb -o "$out" --landmarks landmarks.txt "$@" \
    >stdout.txt 2>stderr.txt || fail "$* ended with $?: $(cat stderr.txt)"
}

carry all.glb
grep -q "^nearest .*'ring'.* 58 of 58 vertices" stdout.txt || fail "the ring is not told of"
grep -q "^skin  *2 joints" stdout.txt || fail "the skin is not told of"
"$characters" check target.glb all.glb || fail "what was carried is not the truth"

carry eight.glb --influences 8 --quiet
[ ! -s stdout.txt ] || fail "--quiet prints"
"$characters" check target.glb eight.glb >/dev/null || fail "--influences 8 differs"
carry again.glb --quiet --threads 1
cmp -s all.glb again.glb || fail "another number of threads gives another file"

# A part alone: what is not asked for is not there.
has() { grep -qa "\"$2\"" "$1"; }
carry skin.glb --only skin
"$characters" same target.glb skin.glb || fail "a skin alone moves the target"
has skin.glb JOINTS_0 || fail "--only skin has no skin"
has skin.glb TEXCOORD_0 && fail "--only skin has texture coordinates"
carry rest.glb --only morphs,uv,colors
"$characters" same target.glb rest.glb || fail "morphs move the target at rest"
has rest.glb JOINTS_0 && fail "--only morphs,uv,colors has a skin"
for name in TEXCOORD_0 COLOR_0 targets targetNames flex; do
  has rest.glb $name || fail "--only morphs,uv,colors has no $name"
done

# The result is a source again.
awk '{ print $4, $5, $6, $4, $5, $6 }' landmarks.txt >same.txt
"$ism_transfer" all.glb target.glb -o twice.glb --landmarks same.txt --quiet ||
  fail "a result is no source"
"$characters" check target.glb twice.glb || fail "a result carried on is not the truth"

# ---- Bad input -----------------------------------------------------------------------------------

# refused SENTENCE ARGUMENT...: the arguments are refused, and the sentence begins like this.
refused() {
  local sentence="ism_transfer: $1" code=0 said
  shift
  "$ism_transfer" "$@" >stdout.txt 2>stderr.txt || code=$?
  said="$(cat stderr.txt)"
  [ "$code" = 2 ] || fail "exit code $code instead of 2: $* said: $said"
  [ ! -s stdout.txt ] || fail "output on stdout: $*"
  [ "$(wc -l <stderr.txt)" = 1 ] || fail "not one sentence: $said"
  [ "${said:0:${#sentence}}" = "$sentence" ] || fail "$* said: $said, not: $sentence"
  [ ! -e out.glb ] || fail "a file appeared: $*"
}

both=(source.glb target.glb -o out.glb)
refused "two files are needed: ism_transfer source.glb target.glb -o out.glb" source.glb
refused "two files are expected, 'x.glb' is one too many" "${both[@]}" x.glb
refused "a file for the result is needed: -o out.glb" source.glb target.glb
refused "-o needs a name that ends in .glb, not 'out.obj'" source.glb target.glb -o out.obj
refused "unknown option '--ony', --help lists them" "${both[@]}" --ony uv
refused "--influences must be 4 or 8, not '5'" "${both[@]}" --influences 5
refused "--only takes some of skin,morphs,uv,colors, not 'bones'" "${both[@]}" --only skin,bones
refused "--only takes some of skin,morphs,uv,colors, not ''" "${both[@]}" --only skin,
refused "-o ./source.glb would overwrite the input source.glb" \
  source.glb target.glb -o ./source.glb
refused "-o none/out.glb: there is no such folder" source.glb target.glb -o none/out.glb
refused "none.glb: there is no such file" none.glb target.glb -o out.glb
refused "none.txt: there is no such file" "${both[@]}" --landmarks none.txt
refused "target.glb: the source has no skin: nothing carried (--only carries the rest)" \
  target.glb source.glb -o out.glb
refused "target.glb: the source has no morph targets: nothing carried" \
  target.glb source.glb -o out.glb --only morphs
refused "target.glb: the source has no texture coordinates: nothing carried" \
  target.glb source.glb -o out.glb --only uv

: >bad.glb
refused "bad.glb: the file is empty" bad.glb target.glb -o out.glb
for size in 3 11 19 40 1000 20000 50000; do
  head -c "$size" source.glb >bad.glb
  refused "bad.glb: no glTF 2.0 file, or a part of one" bad.glb target.glb -o out.glb
done

# A target as text, to be changed: one triangle's worth of a tetrahedron.
gltf() {  # POSITION-BYTES INDEX-BYTES MESHES
  local bytes
  bytes="$(printf "$1$2" | base64 -w 0)"
  cat <<END
{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
 "buffers": [{"byteLength": 60, "uri": "data:application/octet-stream;base64,$bytes"}],
 "bufferViews": [{"buffer": 0, "byteOffset": 0, "byteLength": 48},
                 {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
 "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                "min": [0, 0, 0], "max": [1, 1, 1]},
               {"bufferView": 1, "componentType": 5121, "count": 12, "type": "SCALAR"}],
 "meshes": [$3]}
END
}
zero='\0\0\0\0' one='\0\0\200\077' nan='\0\0\300\177'
corners="$zero$zero$zero$one$zero$zero$zero$one$zero$zero$zero$one"
ids='\0\2\1\0\1\3\1\2\3\0\3\2'
mesh='{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}'
gltf "$corners" "$ids" "$mesh" >good.gltf
"$ism_transfer" source.glb good.gltf -o good.glb --quiet 2>stderr.txt || fail "$(cat stderr.txt)"
"$characters" same good.gltf good.glb || fail "a .gltf file is not read as it is"

refused_target() {  # SENTENCE, then as gltf
  gltf "$2" "$3" "$4" >bad.gltf
  refused "bad.gltf: $1" source.glb bad.gltf -o out.glb
}
refused_target "primitive 0 of mesh 0: the position of vertex 0 is not finite" \
  "$nan$zero$zero${corners#"$zero$zero$zero"}" "$ids" "$mesh"
refused_target "primitive 0 of mesh 0: an index refers to vertex 9, but there are 4" \
  "$corners" '\0\2\1\0\1\11\1\2\3\0\3\2' "$mesh"
refused_target "there are no faces" "$corners" "$ids" \
  '{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 0}]}'
refused_target "it refers to accessor 7, which does not exist" "$corners" "$ids" \
  '{"primitives": [{"attributes": {"POSITION": 7}, "indices": 1}]}'
refused_target "it refers to material 7, which does not exist" "$corners" "$ids" \
  '{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 7}]}'
sed 's/"count": 12/"count": 13/' good.gltf >bad.gltf
refused "bad.gltf: accessor 1 reaches beyond its buffer" source.glb bad.gltf -o out.glb
sed 's/{"mesh": 0}/{"mesh": 0, "children": [0]}/' good.gltf >bad.gltf
refused "bad.gltf: node 0 is a child of itself" source.glb bad.gltf -o out.glb
# changed SED-SCRIPT SENTENCE: good.gltf with a change is refused.
changed() {
  sed "$1" good.gltf >bad.gltf
  cmp -s good.gltf bad.gltf && fail "$1 changes nothing"
  refused "bad.gltf: $2" source.glb bad.gltf -o out.glb
}
changed 's/"version": "2/"version": "1/' "its version of glTF is not 2.0"
changed 's/5121/5120/' "mesh 0 has indices that are not whole numbers from 0"
changed 's/"count": 12/"count": 2/' "there are no faces"
changed 's/"indices": 1}/"attributes": {}}/' "there are no faces"
changed 's/"meshes": .*/"meshes": [{"primitives": [{"attributes": {"NORMAL": 9}}]}]}/' \
  "it refers to accessor 9, which does not exist"
changed 's/"POSITION": 0/"POSITION": 0, "NORMAL": 1/;s/"count": 12/"count": 4/' \
  "mesh 0 has normals that are not three numbers each"
indices='{"bufferView": 1, "componentType": 5120}'
sparse="{\"count\": 1, \"indices\": $indices, \"values\": {\"bufferView\": 0}}"
changed "s/\"bufferView\": 0,/&\"sparse\": $sparse,/" \
  "accessor 0 has sparse values beyond their buffer"
image='{"bufferView": 0, "mimeType": "image\/png"}'
changed "s/byteLength\": 48/&0/;s/\"meshes\"/\"images\": [$image], &/" \
  "buffer view 0 reaches beyond its buffer"
changed 's|data:[^"]*|none.bin|' "no glTF 2.0 file, or a part of one"
changed 's|data:[^"]*|.|' "no glTF 2.0 file, or a part of one: File read error"
deep="$(printf '[%.0s' {1..5000}; printf ']%.0s' {1..5000})"
changed "s/\"scene\": 0,/&\"extras\": $deep,/" \
  "no glTF 2.0 file: its brackets are nested too deeply"

# What is odd, but no harm: a node without properties, a node listed twice, indices left over,
# points beside the triangles.
points='{"attributes": {"POSITION": 0}, "mode": 0}'
sed "s/\"indices\": 1}/&, $points/" good.gltf |
  sed 's/{"mesh": 0}/&, {}/;s/"nodes": \[0\]/"nodes": [0, 1, 0]/;s/"count": 12/"count": 11/' \
    >odd.gltf
"$ism_transfer" source.glb odd.gltf -o odd.glb --iterations 3 >stdout.txt 2>stderr.txt ||
  fail "$(cat stderr.txt)"
grep -q "11 indices are not three per triangle" stdout.txt || fail "left over: $(cat stdout.txt)"
"$characters" same odd.gltf odd.glb || fail "a node without properties is lost"

# Of the source, ids and sizes in the binary file: the same number of bytes.
changed_source() {  # SED-SCRIPT SENTENCE
  LC_ALL=C sed "$1" source.glb >bad.glb
  cmp -s source.glb bad.glb && fail "$1 changes nothing"
  refused "bad.glb: $2" bad.glb target.glb -o out.glb
}
changed_source 's/"joints":\[1,2\]/"joints":[1  ]/' "vertex"
changed_source 's/JSON{/JSOM{/' "no glTF 2.0 file, or a part of one"
changed_source 's/BIN\x00/BIM\x00/' "no glTF 2.0 file, or a part of one"
for offset in 8 12; do  # the length of the file and of its first part
  cp source.glb bad.glb
  printf '\377\377\377\177' | dd of=bad.glb bs=1 seek=$offset conv=notrunc 2>/dev/null
  refused "bad.glb: no glTF 2.0 file, or a part of one" bad.glb target.glb -o out.glb
done
mkdir folder.glb
refused "folder.glb: " folder.glb target.glb -o out.glb
refused "-o folder.glb: this is a folder" source.glb target.glb -o folder.glb

sed 's/"scene": 0,/"scene": 0, "extensionsRequired": ["KHR_draco_mesh_compression"],/' \
  good.gltf >bad.gltf
refused "bad.gltf: its meshes are compressed (KHR_draco_mesh_compression)" \
  source.glb bad.gltf -o out.glb

# ---- Other programs ------------------------------------------------------------------------------

if [ -n "$ism_map" ]; then
  "$ism_map" source.glb target.glb -o map --landmarks landmarks.txt --iterations 3 --quiet \
    2>stderr.txt || fail "ism_map reads no glTF: $(cat stderr.txt)"
  [ -s map/A_on_B.obj ] || fail "ism_map wrote nothing"
fi
if command -v assimp >/dev/null; then
  for file in all.glb skin.glb rest.glb; do
    assimp info "$file" >info.txt || fail "assimp does not read $file"
  done
else
  echo "assimp is missing: no other program looked at the results (assimp-utils)"
fi

validator="${VALIDATOR:-}"
if [ -z "$validator" ] && command -v node >/dev/null && command -v npm >/dev/null; then
  mkdir npm
  (cd npm && timeout 20 npm install --no-audit --no-fund gltf-validator >/dev/null 2>&1) || true
  [ -d npm/node_modules/gltf-validator ] && validator="$work/npm"
fi
if [ -n "$validator" ] && command -v node >/dev/null; then
  cat >validate.js <<'END'
const fs = require('fs');
const validator = require(process.argv[2] + '/node_modules/gltf-validator');
(async () => {
  for (const file of process.argv.slice(3)) {
    const {issues} = await validator.validateBytes(new Uint8Array(fs.readFileSync(file)));
    if (issues.numErrors + issues.numWarnings === 0) continue;
    console.log(file, JSON.stringify(issues.messages.filter(m => m.severity < 2), null, 1));
    process.exitCode = 1;
  }
})();
END
  node validate.js "$validator" {source,target,all,eight,skin,rest,twice,good}.glb ||
    fail "the validator finds errors or warnings"
else
  echo "gltf-validator is missing: npm or the network"
fi
echo "all passed"
