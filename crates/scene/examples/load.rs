//! Loads the scene files named on the command line, and says what came of each and how long it took.

use std::time::Instant;

fn main() {
    for scene in std::env::args().skip(1) {
        let start = Instant::now();
        let outcome = match chiaro_scene::load(&scene) {
            Ok(scene) => {
                let (triangles, nodes) = (scene.triangle_count(), scene.nodes.len());
                format!("{triangles} triangles at {nodes} nodes, {} warnings", scene.warnings.len())
            }
            Err(error) => format!("refused: {error}"),
        };
        println!("{:7.3} s  {scene}: {outcome}", start.elapsed().as_secs_f64());
    }
}
