#!/usr/bin/env bash
# The command line from outside: test_cli.sh <ism_map> <quick_start>
# Bad input must give exit code 2, one sentence and no output folder; a good run must give all
# files, and its results must be a start from which nothing changes.
set -euo pipefail

ism_map="$1"
quick_start="$2"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
cd "$work"

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

# grid N BUMP: an N×N grid of quads as OBJ, on the height field BUMP·x²y.
grid() {
  awk -v n="$1" -v bump="$2" 'BEGIN {
    for (j = 0; j <= n; ++j) for (i = 0; i <= n; ++i)
      printf "v %.6f %.6f %.6f\n", i / n, j / n, bump * (i / n)^2 * (j / n)
    for (j = 0; j < n; ++j) for (i = 0; i < n; ++i) {
      v = 1 + i + j * (n + 1)
      print "f", v, v + 1, v + n + 2, v + n + 1
    }
  }'
}

grid 8 0 >a.obj
grid 10 0.5 >b.obj
printf '# corners\n0 0\n80 120 # opposite\n8 10\n' >marks.txt

# ---- Bad input -----------------------------------------------------------------------------------

# refused SENTENCE ARGUMENT...: the arguments are refused with just this sentence.
refused() {
  local sentence="ism_map: $1" code=0
  shift
  "$ism_map" "$@" >stdout.txt 2>stderr.txt || code=$?
  [ "$code" = 2 ] || fail "exit code $code instead of 2: $*"
  [ ! -s stdout.txt ] || fail "output on stdout: $*"
  [ "$(cat stderr.txt)" = "$sentence" ] || fail "$* said: $(cat stderr.txt), not: $sentence"
  [ ! -e out ] || fail "an output folder appeared: $*"
}

refused "two meshes are needed: ism_map A.obj B.obj -o OUT"
refused "two meshes are needed: ism_map A.obj B.obj -o OUT" a.obj -o out
refused "two files are expected, 'c.obj' is one too many" a.obj b.obj c.obj -o out
refused "a folder for the results is needed: -o OUT" a.obj b.obj
refused "unknown option '--kapa', --help lists them" a.obj b.obj -o out --kapa 2
refused "--kappa needs a value" a.obj b.obj -o out --kappa
refused "--kappa needs a number, not 'two'" a.obj b.obj -o out --kappa two
refused "--kappa needs a number, not 'nan'" a.obj b.obj -o out --kappa nan
refused "--tolerance needs a number, not '1e-4x'" a.obj b.obj -o out --tolerance 1e-4x
refused "--iterations needs a whole number from 0, not '-1'" a.obj b.obj -o out --iterations -1
refused "--iterations needs a whole number from 0, not '1.5'" a.obj b.obj -o out --iterations 1.5
refused "--threads needs a whole number from 0, not ''" a.obj b.obj -o out --threads ""
refused "--set needs NAME=VALUE, not 'coarsest'" a.obj b.obj -o out --set coarsest
names="$("$ism_map" a.obj b.obj -o out --set coarse=5 2>&1 | grep -o "but these: .*coarsest .*" || true)"
[ -n "$names" ] || fail "--set does not say which options there are"
refused "--set: there is no option 'coarse', $names" a.obj b.obj -o out --set coarse=5
refused "--set coarsest needs a whole number from 0, not 'x'" a.obj b.obj -o out --set coarsest=x
refused "--set keep_scale needs 0 or 1, not '2'" a.obj b.obj -o out --set keep_scale=2
refused "option out of range: history_length must be at least 1" \
  a.obj b.obj -o out --set history_length=0
refused "--variant must be pn, spn or full, not 'PN'" a.obj b.obj -o out --variant PN
refused "--measure must be sd, arap, sarap or asap, not 'mips'" a.obj b.obj -o out --measure mips
refused "the only preset is paper, not 'fast'" a.obj b.obj -o out --preset fast
refused "-o needs a name" a.obj b.obj -o ""

refused "none.obj: there is no such file" none.obj b.obj -o out
refused ".: this is not a file" a.obj . -o out
echo "v 0 0 x" >bad.obj
refused "bad.obj, line 1: a vertex needs three numbers" a.obj bad.obj -o out
printf 'v 0,5 0 0\n' >bad.obj
refused "bad.obj, line 1: numbers need a decimal point, not a comma" a.obj bad.obj -o out
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n' >bad.obj
missing="corner 3 of the face refers to a vertex that does not exist (there are 3)"
refused "bad.obj, line 4: $missing" a.obj bad.obj -o out

# invalid IDS ARGUMENT...: refused with one line that names the file and these ids.
invalid() {
  local pattern="$1" code=0
  shift
  "$ism_map" "$@" -o out >stdout.txt 2>stderr.txt || code=$?
  [ "$code" = 2 ] || fail "exit code $code instead of 2: $*"
  [ "$(wc -l <stderr.txt)" = 1 ] || fail "more than one line: $(cat stderr.txt)"
  grep -Eq "^ism_map: .*$pattern" stderr.txt || fail "$* said: $(cat stderr.txt), not: $pattern"
  [ ! -e out ] || fail "an output folder appeared: $*"
}

printf 'v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n' >flat.obj
invalid "flat.obj: no triangle is left" flat.obj b.obj

# refused_marks TEXT SENTENCE: a landmarks file with this text is refused with this sentence.
refused_marks() {
  printf -- "$1" >marks_bad.txt
  refused "marks_bad.txt, line $2" a.obj b.obj -o out --landmarks marks_bad.txt
}

refused_marks '0 121\n' "1: B has no vertex 121, its ids are 0 to 120"
refused_marks '-1 0\n' "1: A has no vertex -1, its ids are 0 to 80"
refused_marks 'curve 1 2\n' "1: a curve has vertex ids of A, then '|', then vertex ids of B"
refused_marks '1 2\ncurve 1 2 | 3 121\n' "2: B has no vertex 121, its ids are 0 to 120"
forms="two vertex ids are expected, or points x y z in place of them"
refused_marks '1 2 3\n' "1: $forms: 2, 4 or 6 numbers (1.5, not 1,5), not 3"
refused_marks 'a,b\n1 x\n' "2: 'x' is no vertex id"
refused_marks '1 0.5 0.5 -0.6\n' "1: the point is 43% of the size of B away from B, 1% is the most:\
 give it in the coordinates of the file of B, or as the id of a vertex"
refused "none.txt: there is no such file" a.obj b.obj -o out --landmarks none.txt

printf '1;2;3\n' >marks_bad.txt
refused "marks_bad.txt, line 1: $forms: 2, 4 or 6 numbers (1.5, not 1,5), not 3" \
  a.obj b.obj -o out --pins marks_bad.txt
refused "none/A.obj: there is no such file" a.obj b.obj -o out --initial none
mkdir start && cp a.obj start/A.obj && cp b.obj start/B.obj
refused "start/A.obj: not every vertex has one vt of its own, as at the seams of closed surfaces" \
  a.obj b.obj -o out --initial start
grid 1 0 | sed 's/^f.*/vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1\/1 2\/2 4\/3 3\/4/' >start/A.obj
refused "start/A.obj: 4 vertices, but the mesh has 81" a.obj b.obj -o out --initial start
touch file
refused "-o file: $PWD/file is not a folder" a.obj b.obj -o file
refused "-o file/x: $PWD/file is not a folder" a.obj b.obj -o file/x
mkdir -p taken/meta_A.obj
refused "-o taken: its meta_A.obj is a folder" a.obj b.obj -o taken
cp start/B.obj B.obj
refused "-o . would overwrite the input B.obj" a.obj B.obj -o .
invalid "coarsest needs a whole number from 0" a.obj b.obj --set coarsest=-1
refused "--morph needs 2 to 100 shapes, not 1" a.obj b.obj -o out --morph 1
refused "--morph needs a whole number from 0, not 'x'" a.obj b.obj -o out --morph x
for name in x/y.glb A.obj ""; do
  refused "--glb needs a name that ends in .glb, of a file in OUT, not '$name'" \
    a.obj b.obj -o out --glb "$name"
done
refused "--transfer-uv: neither A nor B has texture coordinates (vt)" \
  a.obj b.obj -o out --transfer-uv
refused "none.png: there is no such file" a.obj b.obj -o out --texture none.png
refused "a.obj: only PNG, JPEG and binary PPM images can be read" a.obj b.obj -o out --texture a.obj
mkdir -p taken/morph_001.png
rmdir taken/meta_A.obj
refused "-o taken: its morph_001.png is a folder" a.obj b.obj -o taken --morph 3
refused "--boundary must be free, fixed or slide, not 'open'" a.obj b.obj -o out --boundary open

"$ism_map" --help >help.txt
grep -q -- --landmarks help.txt || fail "--help does not help"

# ---- A good run ----------------------------------------------------------------------------------

files="A.obj A_edges_on_B.obj A_on_B.obj B.obj B_on_A.obj meta_A.obj meta_B.obj report.json"
"$ism_map" a.obj b.obj -o out/one --landmarks marks.txt --iterations 5 >stdout.txt 2>stderr.txt ||
  fail "a good run: $(cat stderr.txt)"
[ "$(cd out/one && echo *)" = "$files" ] || fail "the files are $(cd out/one && echo *)"
grep -q "2 is an isometry" stdout.txt || fail "no summary: $(cat stdout.txt)"
grep -q "^iteration   1 " stderr.txt || fail "no progress: $(cat stderr.txt)"
if grep -q nan out/one/*; then fail "NaN in a result"; fi
[ "$(grep -c '^vt ' out/one/A.obj)" = 81 ] || fail "A.obj needs a vt for every vertex"
[ "$(grep -c '^v ' out/one/B_on_A.obj)" = 121 ] || fail "B_on_A.obj must keep the ids of B"
lines=$(grep -c '^l ' out/one/A_edges_on_B.obj)  # of 144 sides of quads, without the 64 diagonals
[ "$lines" -gt 100 ] && [ "$lines" -le 150 ] || fail "A_edges_on_B.obj has $lines lines"
diff <(grep '^f' out/one/meta_A.obj) <(grep '^f' out/one/meta_B.obj) >/dev/null ||
  fail "the faces of the meta mesh differ"
if command -v python3 >/dev/null; then
  python3 -c 'import json; r = json.load(open("out/one/report.json"));
assert r["status"] and r["iterations"][0]["iteration"] == 0
assert r["final"]["iterations"] == len(r["iterations"]) - 1' || fail "report.json"
  # Names that are not UTF-8 are no reason for a report that nobody can read.
  cp a.obj "$(printf 'a\351.obj')"
  "$ism_map" "$(printf 'a\351.obj')" b.obj -o out/latin --iterations 0 --quiet || fail "a\\351.obj"
  python3 -c 'import json; json.load(open("out/latin/report.json", encoding="utf-8"))' ||
    fail "report.json of a\\351.obj"
fi

# Landmarks as spreadsheets and scripts write them give the same bits; points on triangles are met,
# drawn and pinned as vertices are.
printf '\357\273\277source,target\r\n0,0\r\n80.0;120.0\r\n8,1.00001 0 0\r\n' >marks.csv
"$ism_map" a.obj b.obj -o out/csv --landmarks marks.csv --iterations 5 --quiet || fail "marks.csv"
cmp out/one/A.obj out/csv/A.obj || fail "marks.csv is not marks.txt"
printf '0.53,0.51,0,0.52,0.55,0.08\n' >point.txt
echo 20 24 >pins.txt
{ cat point.txt && printf '0.2 0.3 0 0.21 0.3 0.007\n30 0.4 0.4 0.03\n'; } >points.txt
for marks in points.txt "points.txt --exact-landmarks" "point.txt --pin-landmarks" \
  "pins.txt --pins point.txt"; do
  # shellcheck disable=SC2086
  "$ism_map" a.obj b.obj -o out/points --landmarks $marks --iterations 5 --picture >stdout.txt \
    2>stderr.txt || fail "$marks: $(cat stderr.txt)"
  awk '/^ .* on B at the end/ { if ($1 > 0.1 || !/ 0 not covered/) exit 1; n++ }
    END { exit n != 1 }' stdout.txt || fail "$marks: $(cat stdout.txt)"
  grep -o '"pin_residual": [^,}]*' out/points/report.json |
    awk '{ if ($2 > 1e-9) exit 1 }' || fail "$marks: residual"
done

# What is not welded is welded, and told; results have the ids of the input.
awk '/^v / { v[++n] = $0; next } /^f / { for (i = 2; i <= 5; ++i) print v[$i]; m += 4
  print "f", m - 3, m - 2, m - 1, m }' a.obj >soup.obj
echo "0 0
255 120 # the last corner" >soup.txt
"$ism_map" soup.obj b.obj -o out/soup --landmarks soup.txt --iterations 2 >stdout.txt 2>stderr.txt ||
  fail "triangle soup: $(cat stderr.txt)"
grep -q "^             welded 256 vertices to 81$" stdout.txt || fail "soup: $(cat stdout.txt)"
[ "$(grep -c '^v ' out/soup/A_on_B.obj)" = 256 ] || fail "the ids of the soup are lost"
[ "$(grep -c '^f' out/soup/A.obj)" = 128 ] || fail "soup: the faces"

# What a reader has to drop is told first. An STL file has the corners of its triangles only.
{ cat a.obj && printf 'v nan 0 0\nf 1 2\nf 1 1 2 2\n'; } >scraps.obj
awk '/^v / { v[++n] = $2 " " $3 " " $4; next } /^f / { print "facet normal 0 0 1\nouter loop"
  for (i = 2; i <= 5; ++i) print "vertex", v[$i]; print "endloop\nendfacet" }' b.obj |
  sed '1i solid' >b.stl
"$ism_map" scraps.obj b.stl -o out/scraps --iterations 0 >stdout.txt 2>stderr.txt ||
  fail "scraps.obj: $(cat stderr.txt)"
[ "$(sed -n '2,6p' stdout.txt)" = "\
             ignored 1 vertex with a coordinate that is not finite (line 146)
             dropped 1 face of fewer than three corners (line 147)
             dropped 1 face without area (line 148)
             dropped 1 vertex that no triangle uses
B            b.stl: 121 vertices, 200 triangles" ] || fail "scraps.obj: $(cat stdout.txt)"
grep -A 1 '"prepared": \[' out/scraps/report.json |
  grep -q '"ignored 1 vertex with a coordinate that is not finite (line 146)",$' ||
  fail "report.json must tell what was read otherwise"
if grep -q nan out/scraps/*; then fail "NaN in a result"; fi

# Closed surfaces are mapped as a whole; of so small ones, edges are halved.
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n' >closed.obj
"$ism_map" closed.obj closed.obj -o out/closed --iterations 3 --picture --heat >stdout.txt \
  2>stderr.txt || fail "closed surfaces: $(cat stderr.txt)"
grep -q "^closed  *every point of A and B has an image" stdout.txt || fail "$(cat stdout.txt)"
grep -q "^coverage     100.00% of A, 100.00% of B" stdout.txt || fail "$(cat stdout.txt)"

# Textures, colours, pictures, frames. A has texture coordinates, B has none.
awk 'BEGIN { printf "P6\n32 32\n255\n"
  for (y = 0; y < 32; ++y) for (x = 0; x < 32; ++x) printf "%c%c%c", 64 + x, 64 + y, 100 }' >t.ppm
awk '/^v / { print; print "vt", $2, $3; next } /^f / {
  print "f", $2 "/" $2, $3 "/" $3, $4 "/" $4, $5 "/" $5; next } 1' a.obj >a_uv.obj
"$ism_map" a_uv.obj b.obj -o out/all --landmarks marks.txt --iterations 3 --picture --heat \
  --texture t.ppm --transfer-uv --morph 3 --glb all.glb >stdout.txt 2>stderr.txt ||
  fail "--picture and the like: $(cat stderr.txt)"
for name in picture.png morph_000.png morph_002.png texture.png; do
  [ "$(head -c 4 "out/all/$name" | tail -c 3)" = PNG ] || fail "$name is no PNG file"
done
for name in A_textured B_textured; do
  grep -q '^mtllib textured.mtl$' "out/all/$name.obj" &&
    grep -q '^usemtl surface$' "out/all/$name.obj" || fail "$name.obj needs its material"
  [ "$(grep -c '^f.*/' "out/all/$name.obj")" = "$(grep -c '^f' "out/all/$name.obj")" ] ||
    fail "$name.obj: a face without vt"
done
grep -q "^map_Kd texture.png" out/all/textured.mtl || fail "textured.mtl needs the image"
for name in heat_A heat_B; do
  [ "$(head -n 1 "out/all/$name.ply")" = ply ] || fail "$name.ply is no PLY file"
done
[ ! -e out/all/A_uv.obj ] || fail "B has no vt that A could get"
[ "$(grep -c '^v ' out/all/B_uv.obj)" = 121 ] || fail "B_uv.obj must keep the vertices of B"
[ "$(grep -c '^f.*/' out/all/B_uv.obj)" -gt 150 ] || fail "B_uv.obj: hardly any face has a vt"
# With a seam in the middle, and a row of quads without vt: each face has one side, and some none.
awk '/^v / { print; print "vt", $2, $3; print "vt", 10 + $2, $3; next } /^f / {
  if ($2 > 63) { print "f", $2, $3, $4, $5; next }
  t = ($2 - 1) % 9 > 3; print "f", $2 "/" 2 * $2 - 1 + t, $3 "/" 2 * $3 - 1 + t,
  $4 "/" 2 * $4 - 1 + t, $5 "/" 2 * $5 - 1 + t; next } 1' a.obj >a_seam.obj
"$ism_map" a_seam.obj b.obj -o out/seam --landmarks marks.txt --iterations 3 --transfer-uv \
  --texture t.ppm --picture --glb seam.glb --quiet 2>stderr.txt || fail "a seam: $(cat stderr.txt)"
[ "$(grep -c '^f .*/' out/seam/A_textured.obj)" = 112 ] || fail "A_textured.obj: vt from nothing"
awk '/^vt/ { u[++n] = $2 } /^f/ { if (!/\//) { without++; next }
  split($2, p, "/"); split($3, q, "/"); split($4, r, "/"); with[u[p[2]] > 5]++
  if ((u[p[2]] > 5) != (u[q[2]] > 5) || (u[p[2]] > 5) != (u[r[2]] > 5)) exit failed = 1
  } END { exit failed || with[0] < 70 || with[1] < 70 || without < 10 || without > 40 }' \
  out/seam/B_uv.obj || fail "B_uv.obj: faces across the seam, or not those without vt"
[ "$(grep -c '^f' out/all/morph_001.obj)" = "$(grep -c '^f' out/all/meta_A.obj)" ] ||
  fail "the faces of a morph are not those of the meta mesh"

# The glTF file, as other programs see it: A, B and the morph with the texture, A and B with the
# distortion, each the meta mesh, whose polygons are cut into triangles; and what is not covered.
grep -q "results in .*, all.glb$" stdout.txt || fail "--glb: $(cat stdout.txt)"
[ "$(head -c 4 out/all/all.glb)" = glTF ] || fail "all.glb is no glTF file"
if command -v assimp >/dev/null; then
  assimp info out/all/all.glb >assimp.txt 2>&1 || fail "all.glb: $(cat assimp.txt)"
  grep -Eq "^Animations: +1$" assimp.txt || fail "all.glb: no animation in $(cat assimp.txt)"
  grep -Eq "^Textures \(embed.\): +1$" assimp.txt || fail "all.glb: no texture"
  for name in A "A, not covered" B "from A to B" "distortion of A" "distortion of B"; do
    grep -qF "$name" assimp.txt || fail "all.glb: no $name in $(cat assimp.txt)"
  done
  triangles=$(awk '/^f/ { n += NF - 3 } END { print n }' out/all/meta_A.obj)
  faces=$(awk '/^Faces:/ { print $2 }' assimp.txt)
  [ "$faces" -ge "$((5 * triangles))" ] && [ "$faces" -le "$((5 * triangles + 128 + 200))" ] ||
    fail "all.glb has $faces faces, the meta mesh $triangles triangles"
else
  echo "assimp is not installed (Debian and Ubuntu: assimp-utils), all.glb is not looked at"
fi

# The image that was written is read back as it is; so are other forms of PNG files.
"$ism_map" a.obj b.obj -o out/png --texture out/all/texture.png --iterations 0 --quiet ||
  fail "--texture texture.png"
cmp out/all/texture.png out/png/texture.png || fail "--texture changed the image"
if command -v python3 >/dev/null; then
  for form in filters deep palette alpha; do
    python3 - "$form" t.ppm >t.png <<'PY' || fail "the picture t.png"
import struct, sys, zlib
form, pixels = sys.argv[1], open(sys.argv[2], "rb").read()[13:]
size = 32
def paeth(a, b, c):
    return min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
colors = [pixels[3 * i:3 * i + 3] for i in range(size * size)]
palette, depth, kind, step = b"", 8, 2, 3
rows = [b"".join(colors[y * size:(y + 1) * size]) for y in range(size)]
if form == "deep":
    depth, step = 16, 6
    rows = [b"".join(bytes([c, 7]) for c in row) for row in rows]
elif form == "alpha":
    kind, step = 6, 4
    rows = [b"".join(colors[y * size + x] + b"\x11" for x in range(size)) for y in range(size)]
elif form == "palette":  # 256 entries: the first eight rows, again and again, are another picture
    kind, step, palette = 3, 1, b"".join(colors[:256])
    rows = [bytes((y * size + x) % 256 for x in range(size)) for y in range(size)]
data, before = b"", bytes(len(rows[0]))
for y, row in enumerate(rows):
    f = y % 5
    left = lambda i: row[i - step] if i >= step else 0
    corner = lambda i: before[i - step] if i >= step else 0
    guess = [lambda i: 0, left, lambda i: before[i], lambda i: (left(i) + before[i]) // 2,
             lambda i: paeth(left(i), before[i], corner(i))][f]
    data += bytes([f]) + bytes((row[i] - guess(i)) % 256 for i in range(len(row)))
    before = row
def chunk(name, body):
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
header = struct.pack(">IIBBBBB", size, size, depth, kind, 0, 0, 0)
png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header)
png += chunk(b"PLTE", palette) if palette else b""
sys.stdout.buffer.write(png + chunk(b"IDAT", zlib.compress(data)) + chunk(b"IEND", b""))
PY
    "$ism_map" a.obj b.obj -o out/png --texture t.png --iterations 0 --quiet ||
      fail "--texture: $form"
    if [ "$form" != palette ]; then
      cmp out/all/texture.png out/png/texture.png || fail "--texture: $form changed the image"
    fi
  done
fi
head -c 90 out/all/texture.png >cut.png
"$ism_map" a.obj b.obj -o out/cut --texture cut.png 2>stderr.txt && fail "a damaged image"
[ "$(cat stderr.txt)" = "ism_map: cut.png: the image is damaged" ] ||
  fail "cut.png: $(cat stderr.txt)"
# A JPEG file of 8×8 pixels of one colour.
base64 -d <<'JPEG' | gunzip >t.jpg
H4sIAAAAAAACA/t/4/8DBgEvN083BkZGBgZGIGT4f5uhhYGJEQRAJBMIsDCDSFYWFmYWNlY2NjBm5+QAYnY2Ng5uDk4uEACy
eLi5eEAciDYmVmZmVi52NnYuksH/AwyCHAxAyMwoyMAkyMgsyPj/COMioBtZwU4DOhQCGJmYWVjZ2IFO4BYAOpuZGehYVqBL
gTK1QDkGFkFWIUVDRzbhwER2pUIRo8aJCzmUnTYeFA26+EHFOKmoiZNLTFxCUkpVTV1DU8vE1MzcwtLK2cXVzd3D0ys4JDQs
PCIyKjklNS09IzOruKS0rLyisqq5pbWtvaOza9LkKVOnTZ8xc9aixUuWLlu+YuWqTZu3bN22fcfOXYcOHzl67PiJk6cuXb5y
9dr1GzdvPXz0+MnTZ89fvHz18dPnL1+/ff/x8xcjAzMjDGD4B+hxRiZQmLOD/MPIVA6SFGRhVTRkE3IMZE8sFFYyauQQcZq4
cONBTmXjoA+iSUUXucRUTB6qfgR5Cewj4jzURJaP4B6C++f/LQYeZkZghDELMtgz/Ijab2Mfbv//JgA+WPjLaAIAAA==
JPEG
awk 'BEGIN { printf "P6\n8 8\n255\n"; for (i = 0; i < 64; ++i) printf "%c%c%c", 101, 60, 40 }' >flat.ppm
for image in t.jpg flat.ppm; do
  "$ism_map" a.obj b.obj -o "out/$image" --texture "$image" --iterations 0 --quiet ||
    fail "--texture $image"
done
cmp out/t.jpg/texture.png out/flat.ppm/texture.png || fail "--texture t.jpg: other colours"

# The start given back, without an iteration: the same positions, bit by bit. A second time over
# the same folder.
for round in 1 2; do
  "$ism_map" a.obj b.obj -o out/two --initial out/one --iterations 0 --quiet >stdout.txt \
    2>stderr.txt || fail "round $round from own positions: $(cat stderr.txt)"
  cmp out/one/A.obj out/two/A.obj || fail "--initial changed A"
  cmp out/one/B.obj out/two/B.obj || fail "--initial changed B"
done
if [ -s stdout.txt ] || [ -s stderr.txt ]; then fail "--quiet is not quiet"; fi

"$ism_map" a.obj b.obj -o out/three --start-only --quiet || fail "--start-only"
"$ism_map" a.obj b.obj -o out/four --preset paper --kappa 1 --variant spn --threads 1 \
  --keep-scale --tolerance 1e-3 --iterations 2 --quiet || fail "a run with all options"
grep -q '"coverage_weight": 1.0,' out/four/report.json || fail "--kappa must refine the preset"
grep -q '"omega_start": 1000000000.0,' out/four/report.json || fail "--preset paper"

# Swapped planar positions of two vertices are no embedding.
mkdir flipped && cp out/one/B.obj flipped/
awk '/^vt/ { if (++n == 41) { keep = $0; next } if (n == 42) { print; print keep; next } } 1' \
  out/one/A.obj >flipped/A.obj
rm -rf out.keep && mv out out.keep
invalid "initial_f is not an injective embedding" a.obj b.obj --initial flipped
mv out.keep out

# Where not all files can be written, the ones of an earlier run stay.
before=$(cat out/one/* | cksum)
code=0
(ulimit -f 16 && "$ism_map" a.obj b.obj -o out/one --kappa 1 >stdout.txt 2>stderr.txt) || code=$?
[ "$code" = 1 ] || fail "a full disk: exit code $code"
grep -q "^ism_map: out/one/.*: the file cannot be written$" stderr.txt ||
  fail "a full disk: $(cat stderr.txt)"
[ "$(cat out/one/* | cksum)" = "$before" ] || fail "a full disk changed $(ls out/one)"

# no_output SENTENCE FOLDER ARGUMENT...: nothing can be written there, and nothing is left.
no_output() {
  local sentence="ism_map: $1" folder="$2" code=0
  shift 2
  "$ism_map" a.obj b.obj -o "$folder" --iterations 0 "$@" >stdout.txt 2>stderr.txt || code=$?
  [ "$code" != 0 ] || fail "$folder: written"
  tail -n 1 stderr.txt | grep -qF "$sentence" || fail "$folder: $(cat stderr.txt)"
  if find . -name '*.tmp' | grep -q .; then fail "$folder: half a file is left"; fi
}
code=0
(ulimit -f 16 && "$ism_map" a.obj b.obj -o new >stdout.txt 2>stderr.txt) || code=$?
[ "$code" = 1 ] || fail "a full disk: exit code $code"
[ ! -e new ] || fail "a full disk left a folder"
no_output "-o b.obj/x: " b.obj/x
mkdir -p blocked/report.json
no_output "-o blocked: its report.json is a folder" blocked
[ "$(ls blocked)" = report.json ] || fail "files were written before one that cannot be"
mkdir locked && chmod a-w locked
if ! touch locked/x 2>/dev/null; then  # a superuser may write everywhere
  no_output "locked/" locked
  [ -z "$(ls locked)" ] || fail "something is left in locked"
fi
rm -rf blocked locked
if [ -w /dev/full ]; then
  for arguments in "--help" "a.obj b.obj -o full --iterations 0"; do
    code=0
    # shellcheck disable=SC2086
    "$ism_map" $arguments >/dev/full 2>stderr.txt || code=$?
    [ "$code" = 1 ] || fail "$arguments on a full disk: exit code $code"
    tail -n 1 stderr.txt | grep -qx "ism_map: the output cannot be written" ||
      fail "$arguments on a full disk: $(cat stderr.txt)"
  done
  rm -rf full
fi

# A file that ends too early is named; nothing is computed.
for part in 3 30; do
  head -c "$(($(wc -c <a.obj) * part / 100 / 2 * 2))" a.obj >cut.obj
  code=0
  "$ism_map" cut.obj b.obj -o cut --iterations 0 >stdout.txt 2>stderr.txt || code=$?
  [ "$code" = 2 ] || fail "a cut file: exit code $code"
  grep -q "^ism_map: cut.obj" stderr.txt || fail "a cut file: $(cat stderr.txt)"
  [ ! -e cut ] || fail "a cut file left a folder"
done

"$ism_map" a.obj b.obj -o out/arap --measure arap --iterations 3 >stdout.txt 2>/dev/null ||
  fail "--measure"
grep -q " 0 is an isometry" stdout.txt || fail "--measure arap: $(cat stdout.txt)"
grep -q '"coverage_weight": 0.2' out/arap/report.json || fail "--measure arap: kappa"

# Constraints: 40 and 60 are the middles of the grids.
printf '40 60\n' >pins.txt
for pins in "--landmarks marks.txt --pins pins.txt" "--landmarks pins.txt --pin-landmarks"; do
  "$ism_map" a.obj b.obj -o out/pins $pins --iterations 5 --quiet || fail "$pins"
  grep -o '"pin_residual": [^,}]*' out/pins/report.json |
    awk '{ n++; if ($2 > 1e-9) bad = 1 } END { exit n < 5 || bad }' || fail "$pins: residual"
done
(cat marks.txt && echo 'curve 40 41 42 | 60 61 62') >curves.txt
"$ism_map" a.obj b.obj -o out/curves --landmarks curves.txt --iterations 5 --quiet || fail "a curve"
cmp -s out/curves/A.obj out/one/A.obj && fail "a curve has no effect"
printf '1 2\n1 3\n' >twice.txt
code=0
"$ism_map" a.obj b.obj -o out/twice --landmarks twice.txt --exact-landmarks 2>stderr.txt || code=$?
[ "$code" = 2 ] && grep -q "vertex 1 of A is in another landmark" stderr.txt ||
  fail "a vertex in two exact landmarks: $(cat stderr.txt)"
code=0
"$ism_map" a.obj b.obj -o out/far --landmarks marks.txt --pin-landmarks 2>stderr.txt || code=$?
[ "$code" = 2 ] && grep -q "pin: vertex [0-9]* of A is not mapped to B by the start" stderr.txt ||
  fail "a pin outside the overlap: $(cat stderr.txt)"
"$ism_map" a.obj b.obj -o out/exact --landmarks marks.txt --exact-landmarks --iterations 5 \
  --quiet || fail "--exact-landmarks"
for v in 1:1 81:121; do  # vt of the landmarks
  [ "$(grep '^vt' out/exact/A.obj | sed -n "${v%:*}p")" = \
    "$(grep '^vt' out/exact/B.obj | sed -n "${v#*:}p")" ] || fail "--exact-landmarks: $v"
done

printf '4 5\n76 115\n' >middles.txt  # of two sides, so that the corners of a grid become ears
for boundary in fixed slide; do
  "$ism_map" a.obj b.obj -o out/held --landmarks middles.txt --boundary "$boundary" \
    --iterations 5 >stdout.txt 2>/dev/null || fail "--boundary $boundary"
  grep -q "^coverage     100.00% of A, 100.00% of B" stdout.txt ||
    fail "--boundary $boundary: $(cat stdout.txt)"
  grep -q "^added        2 vertices to A, 2 to B" stdout.txt ||
    fail "--boundary $boundary: $(cat stdout.txt)"
  [ "$(grep -c '^v ' out/held/A.obj)" = 83 ] || fail "--boundary $boundary: no vertices added"
  [ "$(head -n 82 out/held/A.obj | grep '^v ')" = "$(head -n 82 out/one/A.obj | grep '^v ')" ] ||
    fail "--boundary $boundary: other vertices changed"
  lines=$(grep -c '^l ' out/held/A_edges_on_B.obj)
  [ "$lines" = 144 ] || fail "--boundary $boundary: $lines of 144 sides of quads"
done
tr -d ' \n' <out/held/report.json |
  grep -E '"added":(.?\{"corners":\[[0-9]+,[0-9]+\],"weights":\[0.5,0.5\]\}){2}' >/dev/null ||
  fail "report.json does not tell the added vertices"
code=0
"$ism_map" a.obj b.obj -o out/held --landmarks marks.txt --pin-landmarks --boundary slide \
  2>stderr.txt || code=$?
[ "$code" = 2 ] && grep -q "is to be pinned, but it is on a boundary that is held" stderr.txt ||
  fail "a pin on a held boundary: $(cat stderr.txt)"

# What closes small openings is in no file: a tube of 8 sides and 40 rings, open at both ends.
awk 'BEGIN {
  for (j = 0; j <= 40; ++j) for (i = 0; i < 8; ++i)
    printf "v %.6f %.6f %.6f\n", cos(i * 0.785398), sin(i * 0.785398), j
  for (j = 0; j < 40; ++j) for (i = 0; i < 8; ++i) {
    v = 1 + i + 8 * j; w = 1 + (i + 1) % 8 + 8 * j
    print "f", v, w, w + 8; print "f", v, w + 8, v + 8
  }
}' >tube.obj
"$ism_map" tube.obj tube.obj -o out/tube --quiet 2>stderr.txt || fail "a tube: $(cat stderr.txt)"
grep -q "the openings of A are small, and it is mapped as if they were closed" stderr.txt ||
  fail "a tube said $(cat stderr.txt)"
for mesh in A B; do
  [ "$(grep -c '^v ' out/tube/$mesh.obj)" = 328 ] && [ "$(grep -c '^f ' out/tube/$mesh.obj)" = 640 ] ||
    fail "$mesh.obj of a tube has $(grep -c '^f ' out/tube/$mesh.obj) triangles"
done

# interrupted FOLDER LINE: runs a long job and presses Ctrl-C when stderr has this line.
interrupted() {
  : >stderr.txt  # else the last run's lines may be taken for this one's
  "$ism_map" big_a.obj big_b.obj -o "$1" --landmarks big_marks.txt --tolerance 0 \
    --iterations 500 >stdout.txt 2>stderr.txt &
  local pid=$! code=0
  until grep -q "$2" stderr.txt || ! kill -0 "$pid" 2>/dev/null; do sleep 0.02; done
  kill -INT "$pid" 2>/dev/null || true
  wait "$pid" || code=$?
  return "$code"
}

grid 40 0 >big_a.obj
grid 50 0.9 >big_b.obj
printf '0 0\n1680 2600\n1640 2550\n' >big_marks.txt
interrupted out/five "^iteration   2 " || fail "Ctrl-C: exit code $?, $(tail -n 1 stderr.txt)"
[ "$(cd out/five && echo *)" = "$files" ] || fail "Ctrl-C: the files are $(echo out/five/*)"
grep -Eq '"status": "(cancelled|stalled|converged)' out/five/report.json || fail "Ctrl-C: status"
code=0
interrupted out/six . || code=$?  # mostly before there is a map
if [ "$code" != 0 ]; then
  [ "$code" = 1 ] || fail "an early Ctrl-C: exit code $code, $(tail -n 1 stderr.txt)"
  [ ! -e out/six ] || fail "an early Ctrl-C wrote $(echo out/six/*)"
  grep -q "^ism_map: cancelled before there was a map" stderr.txt || fail "an early Ctrl-C said $(cat stderr.txt)"
fi

"$quick_start" a.obj b.obj marks.txt >quick_start.txt
grep -q "vertex [0-9]* of A goes to" quick_start.txt || fail "quick_start"
! "$quick_start" a.obj b.obj no_such_file.txt >stdout.txt 2>stderr.txt ||
  fail "quick_start took landmarks from a file that is not there"
grep -q "no_such_file.txt" stderr.txt || fail "quick_start said $(cat stderr.txt)"

echo "all command line tests passed"
