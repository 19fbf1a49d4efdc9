# Figures 5 to 7 from nothing:
#     docker build -t flexfem . && docker run --rm -v "$PWD/figures:/flexfem/reports" flexfem
FROM python:3.11-slim-bookworm

# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install -y --no-install-recommends \
        libgl1 libglu1-mesa libgomp1 libxcursor1 libxft2 libxinerama1 make \
    && rm -rf /var/lib/apt/lists/*

WORKDIR /flexfem
COPY pyproject.toml README.md LICENSE Makefile ./
COPY flexfem ./flexfem
RUN make install
COPY geometry ./geometry
COPY cases ./cases
COPY reports/README.md ./reports/

CMD ["make", "reproduce-figures"]
