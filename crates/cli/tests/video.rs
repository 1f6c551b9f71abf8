//! `chiaro render --frames -o clip.mp4`, with programs of these tests' own in ffmpeg's place, and with ffmpeg where there is one.
#![cfg(unix)]

mod moving;
mod program;

use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use program::{assert_fails, folder, text};

/// Puts a shell script into ffmpeg's place, in a folder that is to be the PATH. It knows `$out`, the file to write.
fn stand_in(folder: &Path, script: &str) {
    let path = folder.join("ffmpeg");
    let script = format!(
        "#!/bin/sh\nPATH=/usr/bin:/bin\ncase $1 in -version) exit 0;; esac\n\
         echo \"$@\" > '{}'\nfor out in \"$@\"; do :; done\nout=${{out#file:}}\n{script}\n",
        folder.join("arguments").display()
    );
    std::fs::write(&path, script).unwrap();
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).unwrap();
}

/// `chiaro render` of the moving scene, with the folder as PATH.
fn command(folder: &Path, arguments: &[&str]) -> Command {
    let moving = moving::write(folder);
    let mut command = Command::new(env!("CARGO_BIN_EXE_chiaro"));
    command.args(["render", &moving, "--samples", "1", "--set", "shadow.resolution=64"]);
    command.args(["--set", "indirect.technique=ambient"]);
    command.args(arguments).env("PATH", folder).current_dir(folder);
    command
}

fn render(folder: &Path, arguments: &[&str]) -> Output {
    command(folder, arguments).output().unwrap()
}

/// Files of a folder that have to do with clips.
fn clips(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap());
    let mut names: Vec<_> = names.filter(|name| name.contains("clip")).collect();
    names.sort();
    names
}

#[test]
fn frames_reach_ffmpeg_as_raw_pixels_and_nothing_else_is_written() {
    let folder = folder("video", "raw");
    stand_in(&folder, "cat > \"$out\"");
    let flags = ["--size", "32x24", "--frames", "0..3", "--fps", "2.5", "-o", "clip.mp4", "--aov", "depth"];
    let output = render(&folder, &flags);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stdout).starts_with("clip.mp4\n"), "{}", text(&output.stdout));
    let depths = (0..3).map(|number| format!("clip.000{number}.depth.exr"));
    assert_eq!(clips(&folder), depths.chain(["clip.mp4".to_owned()]).collect::<Vec<_>>());
    let raw = std::fs::read(folder.join("clip.mp4")).unwrap();
    let frame = 3 * 32 * 24;
    assert_eq!(raw.len(), 3 * frame);
    let arguments = std::fs::read_to_string(folder.join("arguments")).unwrap();
    for words in ["-pixel_format rgb24", "-video_size 32x24", "-framerate 2.5", "-i pipe:0", "-f mp4 file:"] {
        assert!(arguments.contains(words), "`{words}` is not in: {arguments}");
    }
    // What the second picture shows, which goes on from the first.
    let png = render(&folder, &["--size", "32x24", "--frames", "0..2", "--fps", "2.5", "-o", "still.png"]);
    assert!(png.status.success(), "{}", text(&png.stderr));
    let expected = chiaro_image::read(folder.join("still.0001.png")).unwrap();
    let expected = chiaro_image::Picture::from_linear(&expected, 1.0);
    assert!(raw[frame..2 * frame] == *expected.bytes(), "the frame is another than the picture");
    assert!(raw[..frame] != raw[frame..2 * frame], "nothing moves");
}

#[test]
fn without_ffmpeg_nothing_is_begun() {
    let folder = folder("video", "missing");
    let output = render(&folder, &["--size", "32x24", "--frames", "0..3", "-o", "new/clip.mp4"]);
    assert_fails(&output, 1, &["ffmpeg, which writes new/clip.mp4, is not on the PATH", "numbered images"]);
    assert!(!folder.join("new").exists() && !text(&output.stderr).contains("note"), "it began");
    std::fs::write(folder.join("ffmpeg"), "not a program").unwrap();
    let output = render(&folder, &["--frames", "0..3", "-o", "clip.webp"]);
    assert_fails(&output, 1, &["ffmpeg", "clip.webp"]);
    let broken = "#!/bin/sh\necho no libavcodec >&2\nexit 3\n";
    std::fs::write(folder.join("ffmpeg"), broken).unwrap();
    std::fs::set_permissions(folder.join("ffmpeg"), std::fs::Permissions::from_mode(0o755)).unwrap();
    let output = render(&folder, &["--frames", "0..3", "-o", "clip.webp"]);
    assert_fails(&output, 1, &["ffmpeg", "clip.webp", "no libavcodec", "3"]);
    // Images need none.
    let output = render(&folder, &["--size", "8x6", "--frames", "0..1", "-o", "a.png"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
}

#[test]
fn what_ffmpeg_says_last_is_told_and_no_half_file_is_left() {
    let complain = "for n in 1 2 3 4 5; do echo line $n >&2; done";
    for (name, script) in [
        ("at_once", format!("{complain}; exit 7")),
        ("midway", format!("head -c 1000 > \"$out\"; {complain}; exit 7")),
        ("at_the_end", format!("cat > \"$out\"; {complain}; exit 7")),
    ] {
        let folder = folder("video", name);
        stand_in(&folder, &script);
        std::fs::write(folder.join("clip.mp4"), "the one before").unwrap();
        // Larger than a pipe holds.
        let output = render(&folder, &["--size", "256x160", "--frames", "0..3", "-o", "clip.mp4"]);
        let words = ["ffmpeg failed on clip.mp4", "7", "line 2; line 3; line 4; line 5"];
        assert_fails(&output, 1, &words);
        assert!(!text(&output.stderr).contains("line 1"), "{}", text(&output.stderr));
        assert_eq!(clips(&folder), ["clip.mp4"], "{name}");
        assert_eq!(std::fs::read(folder.join("clip.mp4")).unwrap(), b"the one before");
    }
    // Leaving without a word is no success either.
    let folder = folder("video", "silent");
    stand_in(&folder, "exit 0");
    let output = render(&folder, &["--size", "256x160", "--frames", "0..3", "-o", "clip.mp4"]);
    assert_fails(&output, 1, &["clip.mp4"]);
    assert!(clips(&folder).is_empty());
}

#[test]
fn what_is_no_video_is_wrong_usage() {
    let folder = folder("video", "wrong");
    stand_in(&folder, "cat > \"$out\"");
    for (flags, words) in [
        (&["-o", "clip.mp4"][..], &["clip.mp4", "--frames A..B"][..]),
        (&["-o", "clip.webp", "--time", "1"], &["clip.webp", "--frames A..B"]),
        (&["-o", "clip.mp4", "--frames", "0..2", "--size", "33x24"], &["33x24", "even"]),
        (&["-o", "clip.mp4", "--frames", "0..2", "--size", "32x25"], &["32x25", "even"]),
        (&["-o", "clip.mkv", "--frames", "0..2"], &[".mp4", ".webp"]),
        (&["-o", "clip.gif", "--frames", "0..2"], &[".mp4", ".webp"]),
        (&["-o", ".mp4", "--frames", "0..2"], &[".mp4"]),
        (&["-o", "clip.mp4", "--frames", "2..2"], &["no frame"]),
        (&["-o", "clip.mp4", "--frames", "0..2", "--fps", "0"], &["--fps"]),
        (&["-o", "clip.mp4", "--frames", "0..2", "--aov", "dreams"], &["dreams"]),
    ] {
        assert_fails(&render(&folder, flags), 2, words);
    }
    std::fs::create_dir(folder.join("clip.mp4")).unwrap();
    assert_fails(&render(&folder, &["-o", "clip.mp4", "--frames", "0..2"]), 1, &["clip.mp4 is a folder"]);
    std::fs::write(folder.join("file"), "").unwrap();
    let output = render(&folder, &["-o", "file/clip.webp", "--frames", "0..2", "--size", "8x6"]);
    assert_fails(&output, 1, &["cannot create the folder file"]);
}

#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_video_ends_with_the_frames_so_far() {
    let folder = folder("video", "interrupted");
    stand_in(&folder, "cat > \"$out\"");
    let flags = ["--size", "256x160", "--frames", "0..100000", "--fps", "1000", "-o", "clip.webp"];
    let child = command(&folder, &flags).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let part = folder.join(format!("clip.webp.{}.part", child.id()));
    let start = std::time::Instant::now();
    while !std::fs::metadata(&part).is_ok_and(|file| file.len() > 0) {
        assert!(start.elapsed().as_secs() < 120, "no frame came");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let kill = format!("kill -INT {}", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_fails(
        &output,
        1,
        &["ending clip.webp", "interrupted: clip.webp holds the first", "of 100000 frames"],
    );
    assert_eq!(clips(&folder), ["clip.webp"]);
    let bytes = std::fs::metadata(folder.join("clip.webp")).unwrap().len();
    let frame = 3 * 256 * 160;
    assert!(bytes.is_multiple_of(frame) && bytes > 0, "{bytes} bytes are not whole frames");
    let frames = format!("the first {} of", bytes / frame);
    assert!(text(&output.stderr).contains(&frames), "{}", text(&output.stderr));
}

#[test]
fn ffmpeg_itself_makes_a_video_that_it_can_read() {
    if !Command::new("ffmpeg").arg("-version").output().is_ok_and(|known| known.status.success()) {
        return chiaro_testkit::skipped("there is no ffmpeg on the PATH");
    }
    let folder = folder("video", "real");
    let path = std::env::var_os("PATH").unwrap();
    for (name, size, kind) in [("clip.mp4", "64x48", &b"ftyp"[..]), ("-odd: 1%d.webp", "63x47", b"ANIM")] {
        let output = format!("--output={name}");
        let flags = ["--size", size, "--frames", "0..5", "--fps", "10", &output];
        let output = command(&folder, &flags).env("PATH", &path).output().unwrap();
        assert!(output.status.success(), "{}", text(&output.stderr));
        let bytes = std::fs::read(folder.join(name)).unwrap();
        assert!(bytes.windows(4).any(|word| word == kind), "{name}");
        // Animated WebP holds a chunk for each frame; ffmpeg's own reader knows MP4 alone.
        let frames = bytes.windows(4).filter(|word| *word == b"ANMF").count();
        if kind == b"ANIM" {
            assert_eq!(frames, 5);
            continue;
        }
        let read = ["-v", "error", "-i", name, "-f", "rawvideo", "-pix_fmt", "rgb24", "pipe:1"];
        let raw = Command::new("ffmpeg").args(read).current_dir(&folder).output().unwrap();
        assert_eq!(raw.stdout.len(), 5 * 3 * 64 * 48, "{}", text(&raw.stderr));
    }
}
