//! Values for the parameters of a question.

use std::borrow::Cow;
use uuid::Uuid;

/// A value with its type, which PostgreSQL wants to know of an absent one too.
#[derive(Debug, Clone)]
pub(crate) enum Value<'q> {
    Integer(Option<i64>),
    Real(Option<f64>),
    Truth(Option<bool>),
    Id(Option<Uuid>),
    Text(Option<Cow<'q, str>>),
    Bytes(Option<Cow<'q, [u8]>>),
}

/// What can be bound to a parameter.
pub(crate) trait Bind<'q> {
    /// The absent value of this type.
    const ABSENT: Value<'static>;

    /// The value.
    fn value(self) -> Value<'q>;
}

macro_rules! bind {
    ($($type:ty => $variant:ident, $convert:expr;)+) => {$(
        impl<'q> Bind<'q> for $type {
            const ABSENT: Value<'static> = Value::$variant(None);

            fn value(self) -> Value<'q> {
                Value::$variant(Some(($convert)(self)))
            }
        }
    )+};
}

bind! {
    i64 => Integer, |number| number;
    &'q i64 => Integer, |number: &i64| *number;
    u32 => Integer, i64::from;
    u16 => Integer, i64::from;
    f64 => Real, |number| number;
    bool => Truth, |truth| truth;
    Uuid => Id, |id| id;
    String => Text, Cow::Owned;
    &'q String => Text, |text: &'q String| Cow::Borrowed(text.as_str());
    &'q str => Text, Cow::Borrowed;
    Vec<u8> => Bytes, Cow::Owned;
    &'q Vec<u8> => Bytes, |bytes: &'q Vec<u8>| Cow::Borrowed(bytes.as_slice());
    &'q [u8] => Bytes, Cow::Borrowed;
}

impl<'q, T: Bind<'q>> Bind<'q> for Option<T> {
    const ABSENT: Value<'static> = T::ABSENT;

    fn value(self) -> Value<'q> {
        self.map_or(T::ABSENT, T::value)
    }
}

impl<'q, T> Bind<'q> for &'q Option<T>
where
    &'q T: Bind<'q>,
{
    const ABSENT: Value<'static> = <&'q T as Bind<'q>>::ABSENT;

    fn value(self) -> Value<'q> {
        self.as_ref().map_or(Self::ABSENT, <&'q T as Bind<'q>>::value)
    }
}
