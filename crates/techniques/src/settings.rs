//! One declaration of a technique's parameters feeds the command line, the viewer's panel, presets and the docs.
//!
//! [`crate::settings!`] declares a struct whose fields carry meaning (the doc comment), unit, range, default, what a change
//! costs and when it matters; [`crate::choice!`] an enum whose variants have names. [`SettingsGroup`] reads and writes
//! fields as text.

use std::ops::RangeInclusive;

/// What a change of a setting costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effect {
    /// Nothing: a number in a buffer.
    Uniform,
    /// Textures or buffers are made again.
    Resources,
    /// A pipeline is compiled, off the frame.
    Permutation,
}

/// What values a setting takes, for panels that make a widget of it.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// true or false.
    Switch,
    /// One of these names, each with its meaning.
    Choice(&'static [(&'static str, &'static str)]),
    /// A whole number, both ends included.
    Whole(u32, u32),
    /// A number, both ends included.
    Number(f32, f32),
    /// A word, or a number with both ends included.
    WordOrNumber(&'static str, f32, f32),
    /// A word, or ascending numbers above 0 with commas between them, so many at most.
    WordOrList(&'static str, usize),
}

impl std::fmt::Display for Kind {
    /// The values in words, as `chiaro settings` prints them.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Switch => write!(f, "true|false"),
            Self::Choice(names) => {
                let names: Vec<_> = names.iter().map(|(name, _)| *name).collect();
                write!(f, "{}", names.join("|"))
            }
            Self::Whole(low, high) => write!(f, "{low}..{high}"),
            Self::Number(low, high) => write!(f, "{low}..{high}"),
            Self::WordOrNumber(word, low, high) => write!(f, "{word}|{low}..{high}"),
            Self::WordOrList(word, most) => write!(f, "{word}|1 to {most} ascending numbers A,B,…"),
        }
    }
}

/// When a setting does something: clauses such as `shadow.filter=mip|pcf` or `shadow.layout!=none`, with `and` and, less
/// tightly, `or` between them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Condition(pub &'static str);

/// What a [`Condition`] asks of one key.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Clause {
    /// The key.
    pub key: &'static str,
    /// Whether it must have one of the values, or none of them.
    pub has: bool,
    /// Values as they are shown.
    pub values: Vec<&'static str>,
}

impl Condition {
    /// The clauses: of one alternative at least all must be met.
    pub fn alternatives(self) -> impl Iterator<Item = Vec<Clause>> {
        let clause = |text: &'static str| {
            let (key, values) = text.split_once('=').unwrap_or((text, ""));
            let (key, has) = key.strip_suffix('!').map_or((key, true), |key| (key, false));
            Clause { key, has, values: values.split('|').collect() }
        };
        self.0.split(" or ").map(move |all| all.split(" and ").map(clause).collect())
    }
}

impl std::fmt::Display for Condition {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "only with {}", self.0)
    }
}

/// One setting, described.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// `group.name`, as `--set` takes it.
    pub key: String,
    /// What it means, and what more or less of it does.
    pub meaning: String,
    /// Unit of the number, or empty.
    pub unit: &'static str,
    /// Allowed values.
    pub kind: Kind,
    /// Value if not set.
    pub default: String,
    /// Cost of a change.
    pub effect: Effect,
    /// When it matters; `None`: whatever the other settings are.
    pub only: Option<Condition>,
}

/// A type that a setting can have.
pub trait Value: Sized + Clone {
    /// How its range is declared.
    type Range;
    /// Reads a value.
    ///
    /// # Errors
    /// A phrase that says what would be right.
    fn parse(text: &str, range: &Self::Range) -> Result<Self, String>;
    /// Writes it as [`Value::parse`] reads it.
    fn show(&self) -> String;
    /// What values it takes.
    fn kind(range: &Self::Range) -> Kind;
}

impl Value for bool {
    type Range = ();
    fn parse(text: &str, (): &()) -> Result<Self, String> {
        match text {
            "true" | "on" | "1" => Ok(true),
            "false" | "off" | "0" => Ok(false),
            _ => Err("true or false".into()),
        }
    }
    fn show(&self) -> String {
        self.to_string()
    }
    fn kind((): &()) -> Kind {
        Kind::Switch
    }
}

macro_rules! number {
    ($($ty:ty => $kind:ident, $what:literal);*) => {$(
        impl Value for $ty {
            type Range = RangeInclusive<$ty>;
            fn parse(text: &str, range: &Self::Range) -> Result<Self, String> {
                let value = text.parse::<$ty>().ok().filter(|value| range.contains(value));
                value.ok_or_else(|| format!(concat!($what, " in {}"), Self::kind(range)))
            }
            fn show(&self) -> String {
                self.to_string()
            }
            fn kind(range: &Self::Range) -> Kind {
                Kind::$kind(*range.start(), *range.end())
            }
        }
    )*};
}
number!(u32 => Whole, "a whole number"; f32 => Number, "a number");

/// A struct of settings.
pub trait SettingsGroup {
    /// The key's first part.
    const GROUP: &'static str;
    /// All fields, in declaration order.
    fn fields() -> Vec<Field>;
    /// The value of `name` (the key without the group).
    fn get(&self, name: &str) -> Option<String>;
    /// Sets `name` from text; `None` when there is no such field.
    ///
    /// # Errors
    /// A phrase that says what the value may be.
    fn set(&mut self, name: &str, text: &str) -> Option<Result<(), String>>;
}

/// Declares an enum of named choices; the first is the default.
#[macro_export]
macro_rules! choice {
    ($(#[$meta:meta])* pub enum $name:ident { $($(#[doc = $doc:literal])+ $variant:ident = $text:literal),+ $(,)? }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum $name { $($(#[doc = $doc])+ $variant),+ }

        impl $crate::settings::Value for $name {
            type Range = ();
            fn parse(text: &str, (): &()) -> Result<Self, String> {
                match text {
                    $($text => Ok(Self::$variant),)+
                    _ => Err(format!("one of {}", [$($text),+].join(", "))),
                }
            }
            fn show(&self) -> String {
                match self { $(Self::$variant => $text.into()),+ }
            }
            fn kind((): &()) -> $crate::settings::Kind {
                $crate::settings::Kind::Choice(&[$(($text, concat!($($doc),+))),+])
            }
        }
    };
}

/// Declares a struct of settings: `name: Type = default, "unit", range, Effect;`, with the meaning as doc comment.
/// `name as "other.key"` where the key is no identifier; `…, Effect, only "other.key=value";` where it matters only then,
/// see [`settings::Condition`](crate::settings::Condition).
#[macro_export]
macro_rules! settings {
    (
        $(#[$meta:meta])*
        pub struct $name:ident: $group:literal {
            $(
                $(#[doc = $doc:literal])+
                $field:ident $(as $key:literal)? : $ty:ty = $default:expr, $unit:literal, $range:expr, $effect:ident
                $(, only $only:literal)?;
            )+
        }
    ) => {
        $(#[$meta])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name {
            $($(#[doc = $doc])+ $(#[doc = concat!("\n\nOnly with `", $only, "`.")])? pub $field: $ty),+
        }

        impl Default for $name {
            fn default() -> Self { Self { $($field: $default),+ } }
        }

        impl $crate::settings::SettingsGroup for $name {
            const GROUP: &'static str = $group;
            fn fields() -> Vec<$crate::settings::Field> {
                vec![$($crate::settings::Field {
                    key: format!("{}.{}", $group, $crate::settings!(@key $field $($key)?)),
                    meaning: [$($doc),+].map(str::trim).join(" "),
                    unit: $unit,
                    kind: <$ty as $crate::settings::Value>::kind(&$range),
                    default: <$ty as $crate::settings::Value>::show(&$default),
                    effect: $crate::settings::Effect::$effect,
                    only: $crate::settings!(@only $($only)?),
                }),+]
            }
            fn get(&self, name: &str) -> Option<String> {
                $(if name == $crate::settings!(@key $field $($key)?) {
                    return Some($crate::settings::Value::show(&self.$field));
                })+
                None
            }
            fn set(&mut self, name: &str, text: &str) -> Option<Result<(), String>> {
                $(if name == $crate::settings!(@key $field $($key)?) {
                    let value = <$ty as $crate::settings::Value>::parse(text, &$range);
                    return Some(value.map(|value| self.$field = value));
                })+
                None
            }
        }
    };
    (@key $field:ident $key:literal) => { $key };
    (@key $field:ident) => { stringify!($field) };
    (@only $only:literal) => { Some($crate::settings::Condition($only)) };
    (@only) => { None };
}

#[cfg(test)]
mod tests {
    use super::*;

    choice! {
        /// A choice.
        pub enum Shape { /// Round.
            Round = "round", /// Flat.
            Flat = "flat" }
    }
    settings! {
        /// Settings.
        pub struct Sample: "sample" {
            /// How many.
            count: u32 = 3, "things", 1..=8, Resources;
            /// Which shape.
            shape: Shape = Shape::Round, "", (), Permutation;
            /// A nested key,
            /// on two lines.
            bias_slope as "bias.slope": f32 = 0.5, "texels", 0.0..=1.0, Uniform,
                only "sample.shape=flat|round and sample.count!=1 or sample.count=3";
        }
    }

    #[test]
    fn a_condition_is_alternatives_of_clauses() {
        let fields = Sample::fields();
        assert_eq!(fields[0].only, None);
        let only = fields[2].only.unwrap();
        let alternatives: Vec<_> = only.alternatives().collect();
        let clause = |key, has, values: &[&'static str]| Clause { key, has, values: values.to_vec() };
        let first =
            vec![clause("sample.shape", true, &["flat", "round"]), clause("sample.count", false, &["1"])];
        assert_eq!(alternatives, [first, vec![clause("sample.count", true, &["3"])]]);
        assert!(only.to_string().starts_with("only with sample.shape=flat|round and"));
    }

    #[test]
    fn every_default_is_in_its_range_and_reads_back() {
        let mut sample = Sample::default();
        for field in Sample::fields() {
            let name = field.key.strip_prefix("sample.").unwrap();
            assert_eq!(sample.get(name).as_deref(), Some(field.default.as_str()));
            assert_eq!(sample.set(name, &field.default), Some(Ok(())));
        }
        assert_eq!(sample, Sample::default());
    }

    #[test]
    fn a_wrong_value_says_what_is_right_and_changes_nothing() {
        let mut sample = Sample::default();
        for off in ["9", "1.5"] {
            assert_eq!(sample.set("count", off), Some(Err("a whole number in 1..8".into())));
        }
        assert_eq!(sample.set("bias.slope", "NaN"), Some(Err("a number in 0..1".into())));
        assert_eq!(sample.set("shape", "square"), Some(Err("one of round, flat".into())));
        assert_eq!(sample.set("colour", "1"), None);
        assert_eq!(sample, Sample::default());
        assert_eq!(Sample::fields()[2].meaning, "A nested key, on two lines.");
    }
}
