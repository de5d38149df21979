#!/bin/sh
# Makes the certificates of a plant with openssl: sh certificates.sh FOLDER NAME=ADDRESS ... NAME ...
#
# A NAME with an ADDRESS (a host name or an IP address) is a cell to which clients connect; a NAME without one is an operator or a
# viewer. The NAME becomes the common name of the certificate; cell.json5 assigns permissions to common names. The first run also
# makes the authority: ca.pem, and ca.key, which must not be stored on a computer of a machine. Run the script again for further
# names. DAYS sets how long a certificate is valid (365).
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
