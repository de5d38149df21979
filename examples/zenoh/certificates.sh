#!/bin/sh
# Makes the certificates of a plant, with openssl: sh certificates.sh FOLDER NAME=ADDRESS ... NAME ...
#
# A NAME with an ADDRESS (a host's name or its IP address) is a cell that others connect to; one without is an operator or viewer.
# The NAME stands in the certificate as its common name, by which cell.json5 says who may do what. Made once: the authority (ca.pem,
# and ca.key, which is to be kept where no machine is). Run it again for further names; DAYS (365) says how long they are valid.
set -eu
folder=$1
shift
mkdir -p "$folder"
cd "$folder"
umask 077
key="-newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes"

if [ ! -e ca.key ]; then
    openssl req -x509 $key -keyout ca.key -out ca.pem -days 3650 -subj "/CN=plant authority" \
        -addext "keyUsage=critical,keyCertSign,cRLSign"
fi
for each in "$@"; do
    name=${each%%=*}
    address=${each#*=}
    case $address in
        "$name") also=DNS:$name ;;
        *[!0-9.]*) also=DNS:$address ;;
        *) also=IP:$address ;;
    esac
    openssl req $key -keyout "$name.key" -out "$name.csr" -subj "/CN=$name"
    printf 'subjectAltName=%s\nbasicConstraints=CA:FALSE\nextendedKeyUsage=serverAuth,clientAuth\n' "$also" > "$name.ext"
    openssl x509 -req -in "$name.csr" -CA ca.pem -CAkey ca.key -CAcreateserial -days "${DAYS:-365}" \
        -extfile "$name.ext" -out "$name.pem"
    rm "$name.csr" "$name.ext"
done
