//! Parts of the light, which mean the same in pictures and in truths.

use std::str::FromStr;

use chiaro::Aov;
use serde::Serialize;

/// What of the light is compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Part {
    /// All of it.
    #[default]
    Picture,
    /// What glows or is background where it is seen, and light that reaches its first surface unhindered.
    Direct,
    /// What was scattered before.
    Indirect,
    /// What came through mirrors and smooth glass alone, then met one surface that scatters.
    Caustics,
}

impl Part {
    /// All, by the names that flags take.
    pub const ALL: [(Self, &'static str); 4] = [
        (Self::Picture, "picture"),
        (Self::Direct, "direct"),
        (Self::Indirect, "indirect"),
        (Self::Caustics, "caustics"),
    ];

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::ALL.into_iter().find(|(part, _)| *part == self).map_or("", |(_, name)| name)
    }

    /// What a still is asked for; the picture is there anyway.
    pub(crate) fn aov(self) -> Option<Aov> {
        match self {
            Self::Picture => None,
            Self::Direct => Some(Aov::Direct),
            Self::Indirect => Some(Aov::Indirect),
            Self::Caustics => Some(Aov::Caustics),
        }
    }

    /// How often light is scattered from one surface to another on its way to this part: none for those that it reaches
    /// before.
    pub(crate) fn bounces(self, most: Option<u32>) -> u32 {
        match self {
            Self::Direct | Self::Caustics => 0,
            Self::Picture | Self::Indirect => most.unwrap_or(u32::MAX),
        }
    }
}

impl FromStr for Part {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|(_, name)| *name == text);
        found.map(|(part, _)| part).ok_or_else(|| {
            let names = Self::ALL.map(|(_, name)| name).join(", ");
            format!("`{text}` is no part of the light; there are {names}")
        })
    }
}
