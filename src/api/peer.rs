//! Where a request comes from.

use crate::config::Network;
use axum::extract::ConnectInfo;
use axum::http::{Extensions, HeaderMap};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

/// Header in which each proxy adds the address that it was asked by.
const FORWARDED_FOR: &str = "x-forwarded-for";
/// The part of an IPv6 address that a house gets as a whole, bits; what follows its owner chooses at will.
const IPV6_HOUSE_BITS: u32 = 64;

/// The address that a request is counted by: that of the connection, or what trusted proxies say of it. Of `X-Forwarded-For` only
/// the end that such proxies wrote is believed; what stands before it anybody can send. An IPv6 address stands for its network of
/// 64 bits. A request without a connection, as in a test, comes from nowhere in particular.
pub fn peer_address(extensions: &Extensions, headers: &HeaderMap, trusted: &[Network]) -> IpAddr {
    let connected = extensions.get::<ConnectInfo<SocketAddr>>().map(|ConnectInfo(address)| address.ip());
    let nowhere = IpAddr::V4(Ipv4Addr::UNSPECIFIED);
    let mut address = connected.unwrap_or(nowhere).to_canonical();
    let is_trusted = |address: IpAddr| trusted.iter().any(|network| network.contains(address));
    let lines = headers.get_all(FORWARDED_FOR).iter().rev().filter_map(|value| value.to_str().ok());
    for said in lines.flat_map(|line| line.rsplit(',')) {
        if !is_trusted(address) {
            break;
        }
        match address_of(said.trim()) {
            Some(before) => address = before.to_canonical(),
            None => break,
        }
    }
    house_of(address)
}

/// Proxies write an address with or without a port.
fn address_of(text: &str) -> Option<IpAddr> {
    let bare = text.trim_start_matches('[').trim_end_matches(']');
    bare.parse().ok().or_else(|| text.parse::<SocketAddr>().ok().map(|address| address.ip()))
}

fn house_of(address: IpAddr) -> IpAddr {
    match address {
        IpAddr::V4(_) => address,
        IpAddr::V6(address) => {
            let mask = u128::MAX << (128 - IPV6_HOUSE_BITS);
            IpAddr::V6(Ipv6Addr::from_bits(address.to_bits() & mask))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn seen(connected: &str, forwarded: &[&'static str], trusted: &[&str]) -> String {
        let mut extensions = Extensions::new();
        extensions.insert(ConnectInfo(connected.parse::<SocketAddr>().unwrap()));
        let mut headers = HeaderMap::new();
        for line in forwarded {
            headers.append(FORWARDED_FOR, HeaderValue::from_static(line));
        }
        let trusted: Vec<Network> = trusted.iter().map(|text| (*text).to_owned().try_into().unwrap()).collect();
        peer_address(&extensions, &headers, &trusted).to_string()
    }

    #[test]
    fn nobody_is_believed_who_is_no_trusted_proxy() {
        assert_eq!(seen("203.0.113.9:5000", &["10.9.9.9"], &[]), "203.0.113.9");
        assert_eq!(seen("203.0.113.9:5000", &["10.9.9.9"], &["127.0.0.1"]), "203.0.113.9");
    }

    #[test]
    fn the_end_of_the_chain_that_trusted_proxies_wrote_counts() {
        let trusted = ["127.0.0.1", "10.0.0.0/8"];
        assert_eq!(seen("127.0.0.1:1", &["198.51.100.7"], &trusted), "198.51.100.7");
        assert_eq!(seen("127.0.0.1:1", &["1.2.3.4, 198.51.100.7, 10.0.0.5"], &trusted), "198.51.100.7");
        assert_eq!(seen("127.0.0.1:1", &["1.2.3.4", "198.51.100.7:4711"], &trusted), "198.51.100.7");
        assert_eq!(seen("127.0.0.1:1", &["nonsense"], &trusted), "127.0.0.1");
        assert_eq!(seen("127.0.0.1:1", &[], &trusted), "127.0.0.1");
    }

    #[test]
    fn an_ipv6_address_stands_for_its_house() {
        assert_eq!(seen("[2001:db8:1:2:3:4:5:6]:1", &[], &[]), "2001:db8:1:2::");
        assert_eq!(seen("[::ffff:127.0.0.1]:1", &["[2001:db8:1:2::7]:80"], &["127.0.0.0/8"]), "2001:db8:1:2::");
    }
}
