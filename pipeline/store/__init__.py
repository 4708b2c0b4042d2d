"""Files with proof: hashes, manifests, the input registry and the codecs of every artifact."""
