//! Arbitrary bytes as `.glb` or `.gltf`, changed as bytes and as JSON.

#![no_main]

use chiaro_fuzz::mutate::{self, Random};
use chiaro_scene::Memory;
use libfuzzer_sys::{fuzz_mutator, fuzz_target, fuzzer_mutate};

fuzz_target!(|data: &[u8]| {
    let mut files = Memory::default();
    files.insert("a.png", chiaro_fuzz::PNG);
    files.insert("a.bin", data);
    let name = if data.starts_with(b"glTF") { "scene.glb" } else { "scene.gltf" };
    files.insert(name, data);
    chiaro_fuzz::load(&files, name);
});

fuzz_mutator!(|data: &mut [u8], size: usize, max_size: usize, seed: u32| {
    let mut random = Random::new(seed);
    let Some((mut json, mut binary)) = mutate::split(&data[..size]).filter(|_| random.below(10) > 0) else {
        return fuzzer_mutate(data, size, max_size);
    };
    if random.below(4) > 0 {
        mutate::change(&mut json, &mut random);
    }
    if random.below(3) == 0 {
        let used = binary.len();
        binary.resize(used + 16, 0);
        let length = fuzzer_mutate(&mut binary, used, used + 16);
        // The length is usually what the JSON counts on.
        binary.truncate(if random.below(4) == 0 { length } else { used });
    }
    let glb = mutate::join(&json, &binary);
    if glb.len() > max_size {
        return fuzzer_mutate(data, size, max_size);
    }
    data[..glb.len()].copy_from_slice(&glb);
    glb.len()
});
