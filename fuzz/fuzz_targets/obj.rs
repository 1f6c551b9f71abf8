//! Arbitrary text as an `.obj` file with a small material library beside it.

#![no_main]

use chiaro_scene::Memory;
use libfuzzer_sys::fuzz_target;

const LIBRARY: &str = "newmtl a\nKd 1 0 0\nmap_Kd a.png\nnewmtl b\nbump a.png\nnewmtl c\nillum 7\nNi 1.5\nd 0.1\n";

fuzz_target!(|data: &[u8]| {
    let mut files = Memory::default();
    files.insert("a.png", chiaro_fuzz::PNG);
    files.insert("a.mtl", LIBRARY);
    files.insert("scene.obj", data);
    chiaro_fuzz::load(&files, "scene.obj");
});
