#!/usr/bin/env bash
# Tests the pages of `condyle plan`, `condyle ik` and `condyle walk` in headless Chromium. The test needs Node.js with
# npm, which installs the browser and its driver into .venv/page. Without Node.js, or if the installation fails, the test
# is skipped with a message.
# CHROMIUM names another browser. Pictures are written to .venv/page/pages.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."

if ! command -v npm >/dev/null; then
    echo "there is no npm: the page is not tested in a browser"
    exit
fi
program=${CONDYLE_PROGRAM:-${CARGO_TARGET_DIR:-target}/debug/condyle}
[ -x "$program" ] || cargo build --locked -p condyle-cli
folder=$PWD/.venv/page
mkdir -p "$folder/pages"
cp tests/page/package.json tests/page/package-lock.json tests/page/page.test.js "$folder"
if ! cmp -s "$folder/package-lock.json" "$folder/installed"; then
    if ! (cd "$folder" && npm ci --ignore-scripts --silent); then
        echo "npm could install no browser: the page is not tested in one"
        exit
    fi
    cp "$folder/package-lock.json" "$folder/installed"
fi
"$program" plan --out "$folder/pages/reach.html" >/dev/null
"$program" plan --target 0.5,0.3,0.4 --knots 70 --out "$folder/pages/limits.html" >/dev/null
"$program" plan --example trot >"$folder/pages/trot.toml"
"$program" plan "$folder/pages/trot.toml" --out "$folder/pages/trot.html" >/dev/null
"$program" ik arm7 --frame tool --target 0.45,-0.25,0.35,3.1,0,0.2 --out "$folder/pages/posture.html" >/dev/null
cat >"$folder/pages/boxes.urdf" <<'URDF'
<robot name="boxes">
  <link name="base"><collision><geometry><box size="0.2 0.3 0.2"/></geometry></collision></link>
  <link name="upper"><inertial><origin xyz="0 0 0.2"/><mass value="2"/><inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0"
    ixz="0" iyz="0"/></inertial><collision><origin xyz="0 0 0.2"/><geometry><capsule radius="0.05" length="0.3"/></geometry>
    </collision></link>
  <link name="lower"><inertial><origin xyz="0 0 0.2"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0"
    ixz="0" iyz="0"/></inertial><collision><origin xyz="0 0 0.2"/><geometry><cylinder radius="0.04" length="0.3"/></geometry>
    </collision></link>
  <link name="tip"/>
  <joint name="a" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.2"/><axis xyz="0 1 0"/>
    <limit lower="-2.8" upper="2.8" velocity="2" effort="80"/></joint>
  <joint name="b" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0 0 0.45"/><axis xyz="0 1 0"/>
    <limit lower="-2.8" upper="2.8" velocity="2" effort="40"/></joint>
  <joint name="c" type="fixed"><parent link="lower"/><child link="tip"/><origin xyz="0 0 0.4"/></joint>
</robot>
URDF
"$program" ik "$folder/pages/boxes.urdf" --frame tip --target 0.5,0,0.3 --out "$folder/pages/apart.html" >/dev/null
"$program" walk quadruped --command 0.5,0,0 --seconds 1 --rate 50 --out "$folder/pages/walk.html" >/dev/null
# A page is also written for a motion that does not reach its target, so exit status 1 is not an error here.
plan() { "$program" plan "$@" >/dev/null 2>"$folder/pages/notes" || [ $? = 1 ] || { cat "$folder/pages/notes"; exit 1; }; }
plan --robot crates/cli/tests/boxes/boxes.urdf --target 0.2,0.1,0.6 --knots 40 --out "$folder/pages/meshes.html"
# If the environment of the peers contains a humanoid with meshes, the page's time per frame is measured with this robot.
talos=$(find .venv/pinocchio -path '*talos_data/robots/talos_reduced.urdf' 2>/dev/null | head -1)
rm -f "$folder/pages/talos.html"
if [ -n "$talos" ]; then
    plan --robot "$talos" --frame gripper_right_base_link --target 0.45,-0.3,0.2 --knots 60 --max-iterations 10 \
        --out "$folder/pages/talos.html"
fi
cd "$folder" && PAGES="$folder/pages" npm test --silent
