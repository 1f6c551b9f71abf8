//! What frames leave behind, listed and written: `--aov list` and `--aov technique/name`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use chiaro::{Aov, Gpu, Left, LeftOver, Pixels, Recorder, Samples, Settings};
use chiaro_image::{Layers, write_layers};
use chiaro_lab::Session;

use crate::output::{WrongUsage, print};

/// Words of a buffer in a row of its picture.
const ROW: usize = 256;

/// The names of `--aov`, apart: quantities, and what frames leave behind.
pub fn names(asked: &[String]) -> anyhow::Result<(Vec<Aov>, Vec<String>)> {
    let (left, quantities): (Vec<_>, Vec<_>) = asked.iter().cloned().partition(|name| name.contains('/'));
    let quantities = quantities.iter().map(|name| {
        Aov::by_name(name).ok_or_else(|| {
            let names: Vec<_> = Aov::ALL.iter().map(|(_, name)| *name).collect();
            let names = names.join(", ");
            WrongUsage(format!(
                "--aov {name}: there is none of that name; there are {names}, and those of the frame's textures and \
                 buffers: `--aov list` prints them"
            ))
        })
    });
    Ok((quantities.collect::<Result<_, _>>()?, left))
}

/// Tells which quantities these settings leave black, and why.
pub fn warn_of_black(aovs: &[Aov], settings: &Settings) {
    for aov in aovs {
        if let Some(only) = settings.blackens(*aov) {
            eprintln!("warning: --aov {} is black here: there is something to see {only}", aov.name());
        }
    }
}

/// Prints all that `--aov` takes with these settings.
pub fn list(session: &mut Session) -> anyhow::Result<()> {
    let mut text = String::new();
    for (aov, name) in Aov::ALL {
        // Writing to a string does not fail.
        let _ = writeln!(text, "{name:<32} {}", aov.hint().about);
    }
    let mut recorder = Recorder::new(&session.gpu, false);
    let Session { renderer, scene, view, size, .. } = session;
    for resource in renderer.leaves(&mut recorder, scene, view, *size)? {
        let (name, about) = (resource.name.to_string(), resource.hint().about);
        let _ = writeln!(text, "{name:<32} {about} ({resource})");
    }
    session.gpu.check()?;
    print(&text)
}

/// Writes one beside the picture, in files of its own size, and returns which.
pub fn write(gpu: &Gpu, path: &Path, left: LeftOver, samples: u32) -> anyhow::Result<Vec<PathBuf>> {
    let stem = left.name.replace('/', ".");
    let file = |layer: Option<usize>| match layer {
        None => path.with_extension(format!("{stem}.exr")),
        Some(layer) => path.with_extension(format!("{stem}.{layer}.exr")),
    };
    let mut written = Vec::new();
    let mut write = |path: PathBuf, layers: &Layers| -> anyhow::Result<()> {
        write_layers(&path, layers)?;
        written.push(path);
        Ok(())
    };
    match left.content {
        Left::Sum(sum) => {
            let mut sum = sum.wait(gpu)?;
            let share = 1.0 / samples.max(1) as f32;
            sum.bytes = sum.floats().into_iter().flat_map(|value| (value * share).to_ne_bytes()).collect();
            write(file(None), &channels(&sum, left.channels)?)?;
        }
        Left::Plain(texels) => write(file(None), &channels(&texels.wait(gpu)?, left.channels)?)?,
        Left::Layers(layers) => {
            for (layer, texels) in layers.into_iter().enumerate() {
                write(file(Some(layer)), &channels(&texels.wait(gpu)?, left.channels)?)?;
            }
        }
        Left::Buffer(buffer) => write(file(None), &words(&buffer.wait(gpu)?)?)?,
    }
    Ok(written)
}

/// The first channels of a texture, by the names that pictures have for them.
fn channels(texels: &Pixels, count: u8) -> anyhow::Result<Layers> {
    let mut layers = Layers::new(texels.width, texels.height);
    let names = if count == 1 { ["Y", "G", "B", "A"] } else { ["R", "G", "B", "A"] };
    for (name, samples) in names.into_iter().take(count.into()).zip(texels.channels()) {
        match samples {
            Samples::Float(values) => layers.insert(name, values)?,
            Samples::Whole(values) => layers.insert_words(name, values)?,
        }
    }
    Ok(layers)
}

/// Words in rows; what is missing at the end is 0.
fn words(bytes: &[u8]) -> anyhow::Result<Layers> {
    let mut words: Vec<_> = bytes.as_chunks::<4>().0.iter().map(|&word| u32::from_le_bytes(word)).collect();
    let columns = words.len().clamp(1, ROW);
    words.resize(words.len().next_multiple_of(columns).max(1), 0);
    let mut layers = Layers::new(columns as u32, (words.len() / columns) as u32);
    layers.insert_words("Y", words)?;
    Ok(layers)
}
