//! The thesis' tables 6.1 to 6.3: frames a second with and without interleaving and by points a VPL, and what share of a frame
//! each step takes.

use std::fmt::Write as _;

use super::case::{Case, Cost};

/// What the thesis measured: VPLs; frames a second not interleaved, interleaved, and interleaved with half the points.
const THEIRS: [(u32, [u32; 3]); 3] = [(16, [12, 19, 22]), (64, [7, 14, 16]), (256, [2, 5, 6])];

/// Three for each number of VPLs; `points` a VPL, usual and fewer.
pub(super) fn cases(vpls: &[u32], points: [u32; 2]) -> Vec<Case> {
    let three = |&vpls: &u32| {
        let [usual, fewer] = points;
        [
            Case::thesis(format!("{vpls} VPLs, not interleaved"), vpls, usual, false),
            Case::thesis(format!("{vpls} VPLs, interleaved"), vpls, usual, true),
            Case::thesis(format!("{vpls} VPLs, interleaved, {fewer} points each"), vpls, fewer, true),
        ]
    };
    vpls.iter().flat_map(three).collect()
}

/// What [`cases`] took.
pub(super) fn table(costs: &[Cost], vpls: &[u32], points: [u32; 2]) -> String {
    let [usual, fewer] = points;
    let mut text = format!(
        "\n## The thesis' tables 6.1 and 6.2\n\nFrames a second, median; {usual} points a VPL. Not interleaved is not \
         filtered. In brackets what the thesis measured in its scenes.\n\n\
         | VPLs | not interleaved | interleaved | {fewer} points a VPL |\n| ---: | ---: | ---: | ---: |\n"
    );
    for (&vpls, costs) in vpls.iter().zip(costs.chunks(3)) {
        // Writing to a string does not fail.
        let _ = write!(text, "| {vpls} |");
        let theirs = THEIRS.iter().find(|(known, _)| *known == vpls);
        for (column, cost) in costs.iter().enumerate() {
            let _ = write!(text, " {:.1}", cost.frames_per_s());
            if let Some((_, theirs)) = theirs {
                let _ = write!(text, " ({})", theirs[column]);
            }
            text += " |";
        }
        text.push('\n');
    }
    // The middle number of VPLs, interleaved.
    if let Some(cost) = costs.chunks(3).nth(vpls.len() / 2).and_then(|three| three.get(1)) {
        let _ = write!(
            text,
            "\n## The thesis' table 6.3\n\nShare of all passes, {}. There, of a frame of 64: reflective map 9.2 %, imperfect \
             maps 1.4, pull-push 10, camera 12, discontinuities 7.8, parting and joining sub-images 27.7 (here they never \
             are), shading 17.6, blur 14.3.\n\n| step | ms | share |\n| --- | ---: | ---: |\n",
            cost.name
        );
        for step in &cost.steps {
            let _ = writeln!(text, "| {} | {:.3} | {:.1} % |", step.name, step.ms, 100.0 * step.share);
        }
    }
    text
}
