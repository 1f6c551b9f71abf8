//! Arbitrary text as a material library, of which a small `.obj` file uses the first materials.

#![no_main]

use chiaro_scene::Memory;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|data: &[u8]| {
    let text = String::from_utf8_lossy(data);
    let mut obj = String::from("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n");
    for name in text.lines().filter_map(|line| line.trim().strip_prefix("newmtl ")).take(8) {
        obj.push_str(&format!("usemtl {}\nf 1/1 2/2 3/3\n", name.trim()));
    }
    let mut files = Memory::default();
    files.insert("a.png", chiaro_fuzz::PNG);
    files.insert("b.png", chiaro_fuzz::PNG);
    files.insert("a.mtl", data);
    files.insert("scene.obj", obj);
    chiaro_fuzz::load(&files, "scene.obj");
});
