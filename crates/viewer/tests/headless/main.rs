//! The viewer without a window: a storm of resizes and settings, every buffer, shaders that break and heal, the truth.

mod driver;
mod indirect;
mod truth;

use std::path::{Path, PathBuf};

use chiaro::{Kind, Pipeline, Readback, Settings};
use chiaro_testkit::ambient;
use chiaro_viewer::Options;
use egui::Key;

use driver::{Driver, SIZE, mean};

/// Numbers that are the same every time (Steele, Lea & Flood 2014, SplitMix64).
struct Random(u64);

impl Random {
    fn below(&mut self, end: u32) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) % u64::from(end)) as u32
    }

    fn share(&mut self) -> f64 {
        f64::from(self.below(1 << 20)) / f64::from(1 << 20)
    }

    /// A value that a setting of this kind takes.
    fn value(&mut self, key: &str, kind: &Kind) -> String {
        match kind {
            Kind::Switch => (self.below(2) == 1).to_string(),
            Kind::Choice(names) => names[self.below(names.len() as u32) as usize].0.to_owned(),
            Kind::Whole(low, high) => {
                // Large maps and many lights take a software rasteriser seconds, and show nothing that smaller ones do not.
                let most = match key {
                    "indirect.vpls" => 1024,
                    "indirect.points" => 1 << 17,
                    _ if key.ends_with("resolution") => 512,
                    _ => u32::MAX,
                };
                let high = (*high).min(most);
                let low_f = f64::from((*low).max(1));
                let value = low_f * (f64::from(high) / low_f).powf(self.share());
                (value.round() as u32).clamp(*low, high).to_string()
            }
            Kind::Number(low, high) => (low + (high - low) * self.share() as f32).to_string(),
            Kind::WordOrList(word, most) => {
                let count = self.below(*most as u32 + 1);
                let ends = (1..=count).map(|i| format!("{}", 3.0 * f64::from(i) + self.share()));
                if count == 0 { (*word).to_owned() } else { ends.collect::<Vec<_>>().join(",") }
            }
            Kind::WordOrNumber(word, low, high) => {
                if self.below(2) == 0 {
                    (*word).to_owned()
                } else {
                    (low + (high - low) * self.share() as f32).to_string()
                }
            }
        }
    }
}

#[test]
fn resizes_and_settings_at_random_leave_no_trace() {
    let mut driver = Driver::cornell();
    let before = driver.picture();
    assert!(mean(&before) > 20.0, "the picture is black: {}", mean(&before));

    let mut random = Random(7);
    for number in 0..50 {
        driver.size = match number {
            0 => [1, 1],
            1 => [0, 0],
            2 => [0, 200],
            3 => [1, 300],
            4 => [900, 1],
            _ => [random.below(500), random.below(200)],
        };
        driver.frame(Vec::new());
    }
    driver.size = SIZE;

    let fields = Settings::fields();
    let mut refused = 0;
    for number in 0..200 {
        let mut settings = driver.viewer.settings().clone();
        let field = &fields[random.below(fields.len() as u32) as usize];
        let value = random.value(&field.key, &field.kind);
        settings.set(&field.key, &value).unwrap_or_else(|e| panic!("{} = {value}: {e}", field.key));
        if random.below(8) == 0 {
            settings.pipeline =
                if settings.pipeline == Pipeline::Forward { Pipeline::Deferred } else { Pipeline::Forward };
        }
        driver.viewer.set(settings);
        driver.frame(Vec::new());
        refused += u32::from(driver.viewer.settings_error().is_some());
        if number % 25 == 0 {
            driver.settle();
        }
    }
    driver.settle();
    assert!(refused > 0, "no illegal combination was tried: the storm is too tame");

    driver.viewer.set(ambient());
    driver.settle();
    let after = driver.picture();
    assert!(before == after, "the picture is another after the storm");
}

#[test]
fn every_buffer_can_be_looked_at() {
    let mut driver = Driver::cornell();
    let mut settings = ambient();
    settings.set("shadow.representation", "moments").unwrap();
    settings.set("shadow.filter", "gaussian").unwrap();
    driver.viewer.set(settings);
    driver.settle();
    driver.press(Key::P);
    driver.press(Key::P);
    let names: Vec<_> = driver.viewer.buffers().collect();
    for name in
        ["direct", "lights", "direct/radiance", "surface/depth", "shadow/shadow_maps", "direct/light_grid"]
    {
        assert!(names.iter().any(|other| other == name), "{name} is not in {names:?}");
    }
    for name in &names {
        driver.frame(Vec::new());
        let texture = driver.viewer.buffer().unwrap_or_else(|| panic!("{name} is not there"));
        let pixels = Readback::start(&driver.gpu, texture).unwrap().wait(&driver.gpu).unwrap();
        let wrong = pixels.bytes.chunks_exact(4).filter(|p| p[..3] == [255, 0, 255]).count();
        assert_eq!(wrong, 0, "{name} has pixels that are not numbers");
        // Buffers may be all zero; quantities are not unless they say why, nor what pictures are made of.
        let quantity = !name.contains('/') && driver.viewer.black_buffer().is_none();
        if quantity || name == "direct/radiance" || name == "shadow/shadow_maps" {
            assert!(mean(&pixels) > 2.0, "{name} is black");
        }
        driver.press(Key::CloseBracket);
    }
    // What rays leave black says so.
    driver.press(Key::Num5);
    (0..4).for_each(|_| driver.press(Key::CloseBracket));
    assert_eq!(driver.viewer.black_buffer(), None);
    let mut settings = driver.viewer.settings().clone();
    settings.set("shadow.layout", "traced").unwrap();
    driver.viewer.set(settings);
    let why = driver.viewer.black_buffer().unwrap();
    assert!(why.contains("shadow.layout=single|cascaded"), "{why}");
    driver.press(Key::P);
    driver.frame(Vec::new());
    assert!(driver.viewer.buffer().is_none());
    assert_eq!(driver.viewer.black_buffer(), None);
}

#[test]
fn keys_choose_light_and_fly_and_the_picture_comes_to_rest_without_a_step() {
    let mut driver = Driver::cornell();
    let still = driver.picture();
    driver.press(Key::I);
    let direct = driver.picture();
    driver.press(Key::U);
    let indirect = driver.picture();
    driver.press(Key::O);
    assert!(driver.picture() == still, "both together are not what was there before");
    assert!(direct != still && indirect != still && direct != indirect);

    driver.press(Key::W);
    let read = |driver: &Driver| {
        let texture = driver.viewer.picture().expect("a scene is on show");
        Readback::start(&driver.gpu, texture).unwrap().wait(&driver.gpu).unwrap()
    };
    let apart = |a: &chiaro::Pixels, b: &chiaro::Pixels| {
        let both = a.bytes.iter().zip(&b.bytes);
        both.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>() / a.bytes.len() as f64
    };
    let mut pictures = vec![read(&driver)];
    for _ in 0..24 {
        driver.frame(Vec::new());
        pictures.push(read(&driver));
    }
    let at_rest = driver.picture();
    assert!(at_rest != still, "W does not fly");
    let way = apart(&pictures[0], &at_rest);
    let steps: Vec<_> = pictures.windows(2).map(|pair| apart(&pair[0], &pair[1])).collect();
    let largest = steps.iter().copied().fold(0.0, f64::max);
    assert!(way > 0.0 && largest < 0.25 * way, "{way} in all, in steps of {steps:?}");

    // A scene that cannot be read is told, and the old one stays.
    driver.viewer.open("no/such/room.glb");
    driver.settle();
    let messages: Vec<_> = driver.viewer.messages().collect();
    assert!(messages.iter().any(|text| text.contains("room.glb")), "{messages:?}");
    assert!(mean(&driver.picture()) > 20.0);
}

/// A copy of the shaders that a test may change.
fn copied_shaders(name: &str) -> PathBuf {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../techniques/src");
    let folder = std::env::temp_dir().join(format!("chiaro-{name}-{}", std::process::id()));
    for (path, text) in chiaro::techniques::shaders::MODULES {
        let to = folder.join(path);
        std::fs::create_dir_all(to.parent().unwrap()).unwrap();
        // What is compiled in is what lies there: else the folder is not where it is thought to be.
        assert_eq!(std::fs::read_to_string(sources.join(path)).unwrap(), *text);
        std::fs::write(to, text).unwrap();
    }
    folder
}

#[test]
fn a_broken_shader_is_told_with_its_place_and_a_healed_one_is_used() {
    let folder = copied_shaders("reload");
    let options = Options {
        scene: "builtin:cornell".into(),
        settings: ambient(),
        shaders: Some(folder.clone()),
        ..Options::default()
    };
    let mut driver = Driver::new(options);
    driver.settle();
    let before = driver.picture();

    let file = folder.join("post/tone_map.cs.wesl");
    let good = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, good.replace("let value = textureLoad", "let value = texturLoad")).unwrap();
    driver.until("told of the error", |viewer| viewer.shader_error().is_some());
    let error = driver.viewer.shader_error().unwrap().to_owned();
    let line = 1 + good.lines().position(|line| line.contains("let value = textureLoad")).unwrap();
    assert!(
        error.contains(&format!("post/tone_map.cs.wesl:{line}: ")) && error.contains("texturLoad"),
        "{error}"
    );
    assert!(driver.picture() == before, "the last good shader is not in use");

    let inverted = good.replace("vec4f(floor(code) / 255.0, 1.0)", "vec4f(1.0 - floor(code) / 255.0, 1.0)");
    assert_ne!(inverted, good);
    std::fs::write(&file, inverted).unwrap();
    driver.until("healed", |viewer| viewer.shader_error().is_none() && viewer.is_settled());
    let after = driver.picture();
    let sum = mean(&before) + mean(&after);
    assert!((sum - 255.0).abs() < 2.0, "the changed shader is not in use: {sum}");
    std::fs::remove_dir_all(folder).unwrap();
}
